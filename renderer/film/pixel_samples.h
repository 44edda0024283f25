/// renderer/film/pixel_samples.h - the mean of a pixel's samples and its variance.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "base/vec3.h"

namespace narpa {

/// Samples of one pixel, summed in double: 2^24 equal ones are exact to 1e-9, where float stops growing.
class PixelSamples {
public:
    void add(const Rgb& radiance) {
        const Vec3 sample = vec_cast<double>(radiance);
        ++n_;
        sum_ += sample;
        const double delta = mean_band(sample) - mean_;
        mean_ += delta / n_;
        deviations_ += delta * (mean_band(sample) - mean_);
    }
    [[nodiscard]] int count() const { return n_; }
    [[nodiscard]] Vec3 mean() const { return sum_ / static_cast<double>(n_); }
    /// Squared distances of the samples' mean bands from their mean, summed (Welford 1962).
    [[nodiscard]] double squared_deviations() const { return deviations_; }

private:
    Vec3 sum_{};
    double mean_ = 0, deviations_ = 0;
    int n_ = 0;
};

/// The mean, and by how much its mean band moved when the number of samples last reached a power of two: a
/// low-discrepancy sequence is at its best there, and the steps give how fast it converges (frame_error.h).
class PixelMean {
public:
    void add(const Rgb& radiance) {
        sum_ += vec_cast<double>(radiance);
        ++n_;
        if ((n_ & (n_ - 1)) != 0) return;  // std::has_single_bit calls a function on plain x86-64
        const float now = static_cast<float>(mean_band(mean()));
        step_before_ = step_;
        step_ = now - at_power_;
        at_power_ = now;
    }
    [[nodiscard]] std::uint32_t count() const { return n_; }
    [[nodiscard]] Vec3 mean() const { return sum_ / static_cast<double>(n_); }
    /// From half as many samples to the last power of two; there must have been two samples.
    [[nodiscard]] float step() const { return step_; }
    /// The one before; there must have been four.
    [[nodiscard]] float step_before() const { return step_before_; }

private:
    Vec3 sum_{};
    std::uint32_t n_ = 0;
    float at_power_ = 0, step_ = 0, step_before_ = 0;
};

/// Of light in two parts, each with samples of its own number.
struct PixelMeans {
    PixelMean direct, path;

    [[nodiscard]] std::uint32_t count() const { return std::max(direct.count(), path.count()); }
    [[nodiscard]] Vec3 mean() const {
        if (path.count() == 0) return direct.mean();
        return direct.count() == 0 ? path.mean() : direct.mean() + path.mean();
    }
};

/// Samples that the neighbours' common variance counts for in a pixel's own.
inline constexpr double kPriorCount = 64;

/// Variance of each pixel's mean as if its samples were independent, for pixels side by side with equally many
/// samples, at least two.
///
/// A pixel's own sample variance is unreliable below about 64 samples: most pixels with a small bright spot have
/// not met it yet and report zero; where the radiance is spread over decades, the 95 % interval holds the truth in
/// 65 % (4 samples) to 83 % (64) of pixels. So the neighbours' pooled variance enters as kPriorCount samples more,
/// and as the neighbours may be smoother than the pixel itself, its own variance is a lower bound. The result is
/// rather too large than too small: by 0.4 in 4 samples, 0.1 in 64 where all pixels are alike. What low-discrepancy
/// samples gain is VarianceRatio's part (frame_error.h).
inline void variances_of_means(std::span<const PixelSamples> pixels, std::span<double> variances) {
    double pooled = 0;
    for (const PixelSamples& p : pixels) pooled += p.squared_deviations() / (p.count() - 1);
    pooled /= static_cast<double>(pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        const double free = pixels[i].count() - 1, own = pixels[i].squared_deviations();
        const double with_neighbours = (own + kPriorCount * pooled) / (free + kPriorCount);
        variances[i] = std::max(own / free, with_neighbours) / pixels[i].count();
    }
}

}  // namespace narpa
