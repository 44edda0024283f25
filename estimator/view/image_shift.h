/// estimator/view/image_shift.h - how far a target is displaced in a frame from where a render shows it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace narpa {

inline constexpr int kMaxComparedShift_px = 32;
/// A shift whose standard deviation is larger in any direction is not determined.
inline constexpr double kMostUncertainShift_px = 4;

/// From the render to the frame, x right and y down. Found twice, by the largest normalised cross-correlation of
/// the brightness, and of its detail (without what a blur leaves); the more certain one counts.
///
/// The errors of a real model are no noise but shading and albedo that are wrong over whole regions. The covariance
/// is therefore that between parts of the image: of the shifts without one of up to 4 x 4 parts (delete-a-group
/// jackknife: B. Efron, The Jackknife, the Bootstrap and Other Resampling Plans, 1982). If brightness and detail
/// disagree by more than three standard deviations, half of their difference is a standard deviation too.
struct ImageShift {
    double x_px = 0, y_px = 0;
    double sigma_x_px = 0, sigma_y_px = 0;
    double correlation = 0;        ///< of the brightness, at the nearest whole pixel
    bool is_at_limit = false;      ///< kMaxComparedShift_px: it may be larger
    std::string not_determined{};  ///< why the image does not tell it; empty: it does
};

/// Signals above black, row by row; that of the render at the frame's brightness and clipped as the frame is.
struct ShiftInput {
    const std::vector<double>&frame, &render;
    const std::vector<std::uint8_t>& lit;  ///< pixels of the render
    int width = 0, height = 0;
};

/// Nothing where the render is uniform.
[[nodiscard]] std::optional<ImageShift> find_shift(const ShiftInput& input);

}  // namespace narpa
