/// renderer/frame/pixel_samples.h - the mean of a pixel's samples and its variance.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "base/vec3.h"

namespace narpa {

/// Samples of one pixel, summed in double: 2^24 equal samples are exact to 1e-9, whereas a float sum stops growing
/// there.
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
    /// Sum of squared deviations of the samples' mean bands from their mean (Welford 1962).
    [[nodiscard]] double squared_deviations() const { return deviations_; }

private:
    Vec3 sum_{};
    double mean_ = 0, deviations_ = 0;
    int n_ = 0;
};

/// The mean, and the change of its mean band when the number of samples last reached a power of two:
/// low-discrepancy sequences are at their best there, and the steps show how fast the mean converges
/// (frame_error.h).
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
    /// The step before that; there must have been four samples.
    [[nodiscard]] float step_before() const { return step_before_; }

private:
    Vec3 sum_{};
    std::uint32_t n_ = 0;
    float at_power_ = 0, step_ = 0, step_before_ = 0;
};

/// Means of light in two parts, each with its own number of samples.
struct PixelMeans {
    PixelMean direct, path;

    [[nodiscard]] std::uint32_t count() const { return std::max(direct.count(), path.count()); }
    [[nodiscard]] Vec3 mean() const {
        if (path.count() == 0) return direct.mean();
        return direct.count() == 0 ? path.mean() : direct.mean() + path.mean();
    }
};

/// Weight of the neighbours' pooled variance in a pixel's own, in samples.
inline constexpr double kPriorCount = 64;

/// Variance of each pixel's mean as if its samples were independent, for adjacent pixels with equal numbers of
/// samples, at least two.
///
/// A pixel's own sample variance is unreliable below about 64 samples: most pixels with a small bright spot have
/// not met it yet and report zero; where the radiance is spread over decades, the 95 % interval holds the truth in
/// 65 % (4 samples) to 83 % (64) of pixels. So the neighbours' pooled variance is added with a weight of
/// kPriorCount samples, and, as the neighbours may be smoother than the pixel itself, its own variance is a lower
/// bound. The result is biased high: by 0.4 for 4 samples, 0.1 for 64 where all pixels are alike. VarianceRatio
/// (frame_error.h) accounts for the gain of low-discrepancy samples.
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
