#include "renderer/frame/frame_error.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace narpa {
namespace {

/// Limits of the ratio of variances from one doubling to the next: 2^-1.5 for edges, 1/2 for independent samples.
/// Smooth pixels converge faster, but their error does not matter; and if many edges lie at the same place in their
/// pixels, steps can by chance fall faster than the error.
constexpr double kMinRatio = 0.353553, kMaxRatio = 0.5;
/// After a single doubling: between edges and noise.
constexpr double kRatioOfTwo = 0.42;

double left_after(double step, double ratio) {
    return step * ratio / (1 - ratio);
}

double ratio_of(double last, double before) {
    return before == 0 ? kRatioOfTwo : std::clamp(last / before, kMinRatio, kMaxRatio);
}

double squared(float step) {
    return static_cast<double>(step) * static_cast<double>(step);
}

}  // namespace

void VarianceRatio::add(const PixelMean& mean, double independent) noexcept {
    if (mean.count() < 4) return;
    last_ += squared(mean.step()), before_ += squared(mean.step_before());
    independent_ += independent * mean.count() / std::bit_floor(mean.count());
}

double VarianceRatio::value() const noexcept {
    if (independent_ == 0) return 1;
    const double ratio = ratio_of(last_, before_);
    return std::min(1.0, left_after((last_ + ratio * before_) / 2, ratio) / independent_);
}

void FrameError::add_centres(const TileContrast& contrast, double tiles) noexcept {
    float sum = 0;
    for (const float m : contrast.centre) sum += m;
    from_contrasts_ += tiles * static_cast<double>(sum);
}

void FrameError::Part::add(const PixelMean& mean) noexcept {
    const auto level = static_cast<std::size_t>(std::bit_width(mean.count()) - 1);
    steps[level].last += squared(mean.step());
    if (level > 1) steps[level].before += squared(mean.step_before());
    shares[level] += static_cast<double>(std::bit_floor(mean.count())) / mean.count();
    ++pixels[level];
}

void FrameError::add(const PixelMeans& means) noexcept {
    if (means.direct.count() > 0) direct_.add(means.direct);
    if (means.path.count() > 0) path_.add(means.path);
}

void FrameError::add_tile(const TileContrast* contrast, const PerPixel<PixelMeans>& means) noexcept {
    for (std::size_t i = 0; i < kTilePixels; ++i) {
        const std::uint32_t samples = means[i].count();
        if (samples > 1) add(means[i]);
        // Beside one path there may be more samples of the direct part: the contrast is then that of paths alone.
        if (contrast != nullptr && (samples <= 1 || means[i].path.count() == 1))
            from_contrasts_ += static_cast<double>(samples == 0 ? contrast->centre[i] : contrast->of_sample(i));
    }
}

FrameError::Part& FrameError::Part::operator+=(const Part& b) noexcept {
    for (std::size_t i = 0; i < kDoublings; ++i) {
        steps[i].last += b.steps[i].last;
        steps[i].before += b.steps[i].before;
        shares[i] += b.shares[i];
        pixels[i] += b.pixels[i];
    }
    return *this;
}

FrameError& FrameError::operator+=(const FrameError& b) noexcept {
    from_contrasts_ += b.from_contrasts_;
    direct_ += b.direct_;
    path_ += b.path_;
    return *this;
}

double FrameError::Part::squared_error() const noexcept {
    double sum = 0;
    for (std::size_t level = 1; level < kDoublings; ++level) {
        if (pixels[level] == 0) continue;
        const auto [last, before] = steps[level];
        sum += left_after(last, ratio_of(last, level == 1 ? 0 : before)) * shares[level] /
               static_cast<double>(pixels[level]);
    }
    return sum;
}

double FrameError::standard_error(std::size_t pixels) const noexcept {
    const double sum = from_contrasts_ + direct_.squared_error() + path_.squared_error();
    return std::sqrt(sum / static_cast<double>(pixels));
}

}  // namespace narpa
