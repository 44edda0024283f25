/// estimator/view/frame_comparison.h - how well a rendered model fits a frame: lit area, brightness, shift,
/// residual.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/view/image_shift.h"
#include "estimator/view/measured_image.h"

namespace narpa {

/// What a frame should show, row by row.
struct ExpectedFrame {
    std::vector<float> signal;       ///< expected_signal
    std::vector<float> variance;     ///< of `signal` by its samples, DN^2; empty: none
    std::vector<std::int32_t> body;  ///< index of the body at each pixel's centre, -1 none (Aovs::body)
    /// Of a frame that was rendered as well: the variance by its samples over `variance`; 0: of a camera.
    double frame_variance_ratio = 0;
    /// False: the frame may show anything behind the bodies, and only pixels of the target count.
    bool knows_background = true;
};

/// With fewer lit pixels nothing is compared.
inline constexpr std::size_t kFewestLit = 12;

/// Signals are DN above black. A pixel is lit if its signal exceeds five standard deviations of the noise without
/// light, and a tenth of the brightest hundredth's signal, among as many pixels as the render lights; for the
/// render, scaled to the light of the frame.
struct FrameComparison {
    /// Black level of the frame: mean over the pixels in which the render has neither light nor a body; the
    /// sensor's if these are fewer than a hundredth.
    double black_dn = 0;
    std::size_t lit_frame = 0, lit_render = 0, lit_both = 0;
    /// Pixels lit in only one of them, where both differ by more than four standard deviations of the noise of
    /// sensor and samples.
    std::size_t lit_one_beyond_noise = 0;
    /// Gain and the fields below are of the pixels lit in either image that are neither clipped in the frame nor
    /// beyond the frame's limit in the render. gain: light of the frame over that of the render: frame = black +
    /// gain * render.
    double gain = 0;
    std::optional<double> correlation;  ///< Pearson; nothing where frame or render is uniform
    double residual_dn = 0;             ///< root mean square of frame - black - gain * render
    double mean_dn = 0;                 ///< mean signal of the frame
    /// Root mean square of the residuals over the noise of sensor and render; nothing of a camera without a
    /// detector.
    std::optional<double> residual_noise;
    std::optional<ImageShift> shift;   ///< nothing where the render is uniform
    std::vector<std::uint8_t> usable;  ///< pixels of no other body that are not clipped

    /// Pixels lit in both over pixels lit in either.
    [[nodiscard]] double overlap() const {
        const std::size_t either = lit_frame + lit_render - lit_both;
        return either > 0 ? static_cast<double>(lit_both) / static_cast<double>(either) : 0;
    }
    /// The same, not counting differences that noise explains.
    [[nodiscard]] double overlap_beyond_noise() const {
        const std::size_t either = lit_both + lit_one_beyond_noise;
        return either > 0 ? static_cast<double>(lit_both) / static_cast<double>(either) : 0;
    }
};

/// Pixels that show another body than `target` do not count. All are of the frame's size. Errors: fewer than
/// kFewestLit pixels are lit in the render, or unclipped; none in the frame.
[[nodiscard]] Result<FrameComparison> compare_frame(const MeasuredImage& frame, const SensorModel& sensor,
                                                    const ExpectedFrame& render, std::size_t target);

}  // namespace narpa
