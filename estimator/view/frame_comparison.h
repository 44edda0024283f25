/// estimator/view/frame_comparison.h - how well a model fits a frame: what both light, brightness, shift, residual.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/view/measured_image.h"
#include "renderer/image/radiance_image.h"

namespace narpa {

/// Signals are DN above black. A pixel is lit where its signal exceeds a tenth of that of the brightest hundredth
/// of as many pixels as the render lights, and five standard deviations of the noise without light; of the render,
/// scaled to the light of the frame. All but the shift is of the pixels lit in either.
struct FrameComparison {
    double black_dn = 0;  ///< of the frame: median where the render has neither light nor a body
    std::size_t lit_frame = 0, lit_render = 0, lit_both = 0;
    double gain = 0;         ///< frame = black + gain * render, least squares
    double correlation = 0;  ///< of frame and render (Pearson)
    double residual_dn = 0;  ///< root mean square of frame - black - gain * render
    double mean_dn = 0;      ///< mean signal of the frame
    /// Root mean square of the residuals over the sensor's noise; nothing of a camera without a detector.
    std::optional<double> residual_noise;
    /// From where the render shows what is lit to where the frame does, px: largest normalised cross-correlation,
    /// up to kMostComparedShift_px.
    double shift_x_px = 0, shift_y_px = 0;
    double shifted_correlation = 0;  ///< at the nearest whole pixel

    /// Lit in both, as a part of what is lit in either.
    [[nodiscard]] double overlap() const {
        const std::size_t either = lit_frame + lit_render - lit_both;
        return either > 0 ? static_cast<double>(lit_both) / static_cast<double>(either) : 0;
    }
};
inline constexpr int kMostComparedShift_px = 32;

/// `render`: expected radiance; `body`: what each pixel's centre shows, -1 nothing (Aovs::body). Pixels that show
/// another body than `target` do not count, nor, but for `overlap`, those where the frame is clipped. All of the
/// frame's size. Errors: nothing is lit in the frame, or in the render.
[[nodiscard]] Result<FrameComparison> compare_frame(const MeasuredImage& frame, const SensorModel& sensor,
                                                    const RadianceImage& render, std::span<const std::int32_t> body,
                                                    std::size_t target);

}  // namespace narpa
