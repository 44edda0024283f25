/// estimator/view/frame_comparison.h - how well a model fits a frame: what both light, brightness, shift, residual.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/view/measured_image.h"

namespace narpa {

/// What a frame should show, row by row.
struct ExpectedFrame {
    std::vector<float> signal;       ///< expected_signal
    std::vector<float> variance;     ///< of `signal` by its samples, DN^2; empty: none
    std::vector<std::int32_t> body;  ///< what each pixel's centre shows, -1 nothing (Aovs::body)
};

inline constexpr int kMostComparedShift_px = 32;
/// Fewer pixels say nothing.
inline constexpr std::size_t kFewestLit = 12;

/// Signals are DN above black. A pixel is lit where its signal exceeds a tenth of that of the brightest hundredth
/// of as many pixels as the render lights, and five standard deviations of the noise without light; of the render,
/// scaled to the light of the frame.
struct FrameComparison {
    /// Of the frame: mean where the render has neither light nor a body; the sensor's with fewer than a hundredth
    /// of such pixels.
    double black_dn = 0;
    std::size_t lit_frame = 0, lit_render = 0, lit_both = 0;
    /// The others are of the pixels lit in either that are neither clipped in the frame nor brighter than it can be
    /// in the render. Light of the frame over that of the render: frame = black + gain * render.
    double gain = 0;
    std::optional<double> correlation;  ///< Pearson; nothing where frame or render is uniform
    double residual_dn = 0;             ///< root mean square of frame - black - gain * render
    double mean_dn = 0;                 ///< mean signal of the frame
    /// Root mean square of the residuals over the noise of sensor and render; nothing of a camera without a
    /// detector.
    std::optional<double> residual_noise;
    /// From where the render shows what is lit to where the frame does, x right and y down: largest normalised
    /// cross-correlation, that at the nearest whole pixel. At most kMostComparedShift_px, where it may be more.
    struct Shift {
        double x_px = 0, y_px = 0, correlation = 0;
        bool is_at_limit = false;
    };
    std::optional<Shift> shift;        ///< nothing where the render is uniform
    std::vector<std::uint8_t> usable;  ///< pixels of no other body that are not clipped

    /// Lit in both, as a part of what is lit in either.
    [[nodiscard]] double overlap() const {
        const std::size_t either = lit_frame + lit_render - lit_both;
        return either > 0 ? static_cast<double>(lit_both) / static_cast<double>(either) : 0;
    }
};

/// Pixels that show another body than `target` do not count. All are of the frame's size. Errors: fewer than
/// kFewestLit pixels are lit in the render, or unclipped; none in the frame.
[[nodiscard]] Result<FrameComparison> compare_frame(const MeasuredImage& frame, const SensorModel& sensor,
                                                    const ExpectedFrame& render, std::size_t target);

}  // namespace narpa
