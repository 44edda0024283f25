/// renderer/camera/signal_levels.h - how a frame's light fits the scale of the camera's digital numbers.
#pragma once

#include "base/radiance_image.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Statistics of the mean photosignal, before noise and differences between pixels. In fractions of full scale: the
/// full well or the end of the converter, whichever comes first; without a detector, white_radiance. A pixel with
/// several bands counts by its brightest, a pixel of a mosaic by the band of its filter.
struct SignalLevels {
    static constexpr double kLit = 0.01;

    double saturated_share = 0;  ///< of all pixels: at full scale or above, with dark current
    double lit_share = 0;        ///< of all pixels: above kLit times the lesser of full scale and `brightest`
    double bright = 0;           ///< 99th percentile of the lit pixels; may exceed 1
    double brightest = 0;        ///< of any pixel; may exceed 1
    double dark = 0;             ///< mean dark current
    double darkest_step = 0;     ///< smaller signals are 0 in the bytes of the camera's format

    [[nodiscard]] bool is_black() const noexcept { return brightest < darkest_step; }
    /// Dark current alone fills half of the scale.
    [[nodiscard]] bool is_filled_by_dark_current() const noexcept { return dark >= 0.5; }
    /// More than a tenth of the lit pixels and more than 0.1 % of all are saturated; fewer are glints and bright
    /// stars.
    [[nodiscard]] bool is_overexposed() const noexcept {
        return saturated_share > 1e-3 && saturated_share > 0.1 * lit_share;
    }
};

/// `radiance`: of the camera's size.
[[nodiscard]] SignalLevels signal_levels(const Camera& camera, const RadianceImage& radiance);

}  // namespace narpa
