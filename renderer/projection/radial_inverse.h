/// renderer/projection/radial_inverse.h - initial value for inverting a radial distortion: a table of the
/// undistorted radius r over the distorted radius r'.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace narpa {

/// Inverse of a function r'(r) that grows from r'(0) = 0 up to some r, and is not used beyond.
class RadialInverse {
public:
    /// `distorted(r)` and its derivative `slope(r)`. The domain ends at `at_most`, or where the slope leaves
    /// kMinSlope .. kMaxSlope.
    template <class Distorted, class Slope>
    RadialInverse(double at_most, const Distorted& distorted, const Slope& slope) {
        constexpr int kSteps = 1 << 14;
        const double step = at_most / kSteps;
        const auto grows = [&](double r) {
            const double s = slope(r);
            return s > kMinSlope && s < kMaxSlope;
        };
        int good = 0;
        while (good < kSteps && grows((good + 1) * step)) ++good;
        most_ = good * step;
        if (good < kSteps) {
            double bad = (good + 1) * step;
            for (int i = 0; i < 60; ++i) {
                const double middle = 0.5 * (most_ + bad);
                (grows(middle) ? most_ : bad) = middle;
            }
        }
        max_distorted_ = distorted(most_);
        per_entry_ = kEntries / max_distorted_;
        ratio_[0] = 1 / slope(0);
        for (std::size_t i = 1; i <= kEntries; ++i) {
            const double wanted = max_distorted_ * static_cast<double>(i) / kEntries;
            double low = 0, high = most_;
            for (int k = 0; k < 60; ++k) {
                const double middle = 0.5 * (low + high);
                (distorted(middle) < wanted ? low : high) = middle;
            }
            ratio_[i] = high / wanted;
        }
        ratio_[kEntries + 1] = ratio_[kEntries];
    }

    /// The domain: r <= most(), r' <= max_distorted().
    [[nodiscard]] double most() const noexcept { return most_; }
    [[nodiscard]] double max_distorted() const noexcept { return max_distorted_; }

    /// r / r', approximately; beyond the domain most() / r', the rim.
    [[nodiscard]] double ratio(double distorted) const noexcept {
        const double place = std::min(distorted * per_entry_, static_cast<double>(kEntries));
        const auto i = static_cast<std::size_t>(static_cast<int>(place));
        const double part = place - static_cast<double>(static_cast<int>(place));
        const double inside = ratio_[i] + part * (ratio_[i + 1] - ratio_[i]);
        return distorted > max_distorted_ ? most_ / distorted : inside;
    }

private:
    static constexpr std::size_t kEntries = 256;
    static constexpr double kMinSlope = 1e-3;  ///< relative to the centre; below, the image folds over
    static constexpr double kMaxSlope = 1e6;   ///< no real lens exceeds it
    double most_ = 0, max_distorted_ = 0, per_entry_ = 0;
    std::array<double, kEntries + 2> ratio_{};
};

}  // namespace narpa
