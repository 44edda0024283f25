#include "renderer/trace/frame_error.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace narpa {
namespace {

/// Ratios of the variances of twice as many samples that are believed: from that of edges to that of independent
/// samples. Smooth pixels do better, but leave no error that counts; and where many edges have the same place in
/// their pixels, steps fall by chance faster than the error does.
constexpr double kLeastRatio = 0.353553, kMostRatio = 0.5;
/// Where only one doubling was seen: between edges and noise.
constexpr double kRatioOfTwo = 0.42;

double left_after(double step, double ratio) {
    return step * ratio / (1 - ratio);
}

}  // namespace

void FrameError::add_middles(const TileContrast& contrast, double tiles) noexcept {
    float sum = 0;
    for (const float m : contrast.middle) sum += m;
    middles_ += tiles * static_cast<double>(sum);
}

void FrameError::add(const PixelMean& mean) noexcept {
    const auto level = static_cast<std::size_t>(std::bit_width(mean.count()) - 1);
    const auto squared = [](float step) { return static_cast<double>(step) * static_cast<double>(step); };
    steps_[level].last += squared(mean.step());
    if (level > 1) steps_[level].before += squared(mean.step_before());
    shares_[level] += static_cast<double>(std::bit_floor(mean.count())) / mean.count();
    ++pixels_[level];
}

void FrameError::add_tile(const TileContrast& contrast, const PerPixel<PixelMean>& means) noexcept {
    for (std::size_t i = 0; i < kTilePixels; ++i)
        if (means[i].count() == 0)
            middles_ += static_cast<double>(contrast.middle[i]);
        else
            add(means[i]);
}

FrameError& FrameError::operator+=(const FrameError& b) noexcept {
    middles_ += b.middles_;
    for (std::size_t i = 0; i < kDoublings; ++i) {
        steps_[i].last += b.steps_[i].last;
        steps_[i].before += b.steps_[i].before;
        shares_[i] += b.shares_[i];
        pixels_[i] += b.pixels_[i];
    }
    return *this;
}

double FrameError::standard_error(std::size_t pixels) const noexcept {
    double sum = middles_;
    for (std::size_t level = 1; level < kDoublings; ++level) {
        if (pixels_[level] == 0) continue;
        const auto [last, before] = steps_[level];
        const double ratio =
            level == 1 || before == 0 ? kRatioOfTwo : std::clamp(last / before, kLeastRatio, kMostRatio);
        sum += left_after(last, ratio) * shares_[level] / static_cast<double>(pixels_[level]);
    }
    return std::sqrt(sum / static_cast<double>(pixels));
}

}  // namespace narpa
