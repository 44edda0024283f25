#include "apps/commands/exposure_advice.h"

#include <fmt/format.h>

#include <algorithm>

namespace narpa::cli {
namespace {

/// Target level of the brightest parts of an image, as a fraction of full scale.
constexpr double kAim = 0.7;
/// Larger changes of white_radiance, and shorter exposures, mend nothing: a number has another unit, or the bodies
/// are hardly in the image.
constexpr double kMostChange = 1e4, kShortest_s = 1e-8;

std::string hopeless(double factor) {
    return fmt::format(
        "no exposure mends a factor of {:.0e}: see the units of the camera's numbers, and size and distance of the "
        "bodies, which `narpa check` prints",
        factor);
}

/// Text that names the key and its value for bright parts at kAim.
std::string change(const Camera& camera, const SignalLevels& levels) {
    const double factor = kAim / levels.bright;
    if (!camera.detector && (factor > kMostChange || factor < 1 / kMostChange)) return hopeless(factor);
    if (!camera.detector)
        return fmt::format("expected white_radiance of about {:.2g} (it is {:.3g}) in the camera",
                           camera.white_radiance / factor, camera.white_radiance);
    const double now_s = camera.detector->exposure_s, period_s = 1e-9 * static_cast<double>(camera.period_ns);
    const double exposure_s = std::min(factor * now_s, period_s);
    if (exposure_s < kShortest_s) return hopeless(factor);
    const char* more = factor > 1 ? exposure_s < period_s ? ", or a smaller f_number"
                                                          : " (all of the period) and a smaller f_number"
                                  : ", or a larger f_number";
    return fmt::format(
        "expected exposure_s of about {:.2g} (with exposure_stops it is {:.3g}){} in [camera.detector]", exposure_s,
        now_s, more);
}

}  // namespace

std::string percent(double share) {
    return share >= 0.1 ? fmt::format("{:.0f} %", 100 * share) : fmt::format("{:.2g} %", 100 * share);
}

std::string exposure_advice(const Camera& camera, const SignalLevels& levels) {
    if (levels.is_filled_by_dark_current())
        return fmt::format(
            "dark current fills {} of full scale, expected a shorter exposure_s or a smaller "
            "dark_current_e_s in [camera.detector]",
            percent(levels.dark));
    if (!(levels.brightest > 0)) return {};
    if (levels.is_black())
        return fmt::format("the image is black: its brightest pixel has {} of full scale; {}",
                           percent(levels.brightest), change(camera, levels));
    if (levels.is_overexposed())
        return fmt::format("{} of the pixels are saturated ({} have light); {}", percent(levels.saturated_share),
                           percent(levels.lit_share), change(camera, levels));
    return {};
}

nlohmann::json signal_json(const SignalLevels& levels) {
    return {{"saturated_share", levels.saturated_share},
            {"lit_share", levels.lit_share},
            {"bright", levels.bright},
            {"brightest", levels.brightest}};
}

}  // namespace narpa::cli
