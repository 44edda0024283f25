#include "renderer/scene_file/doubtful_units.h"

#include <fmt/format.h>

#include <span>
#include <string_view>

namespace narpa {
namespace {

struct LikelyUnit {
    std::string_view name;
    double size;  ///< in the unit of the key
};

/// A number of a camera, and the values that real cameras have, with a wide margin.
struct UsualRange {
    std::string_view key;
    double low, high;
    std::string_view what;              ///< "of real detectors"
    std::span<const LikelyUnit> units;  ///< tried in this order
};

constexpr LikelyUnit kPitchUnits[]{{"micrometres", 1e-6}, {"millimetres", 1e-3}, {"nanometres", 1e-9}},
    kApertureUnits[]{{"millimetres", 1e-3}, {"centimetres", 1e-2}, {"micrometres", 1e-6}},
    kTimeUnits[]{{"milliseconds", 1e-3}, {"microseconds", 1e-6}, {"nanoseconds", 1e-9}},
    kChargeUnits[]{{"thousands of electrons", 1e3}};
constexpr UsualRange kUsualPitch{"pixel_pitch_m", 2e-7, 5e-4, "pixels of 0.2 um to 0.5 mm", kPitchUnits},
    kUsualStop{"f_number", 0.5, 1000, "0.5 to 1000: focal length over aperture", {}},
    kUsualExposure{"exposure_s", 1e-8, 1e5, "10 ns to a day", kTimeUnits},
    kUsualWell{"full_well_e", 200, 1e9, "200 to 1e9 electrons", kChargeUnits},
    kUsualAperture{"aperture_diameter_m", 1e-5, 10, "10 um to 10 m", kApertureUnits};

/// The sentence for a value outside of its range; with the unit that would bring it in, if there is one.
std::string doubt(const UsualRange& usual, double value) {
    if (value >= usual.low && value <= usual.high) return {};
    std::string text = fmt::format("{} = {:g} is unusual, expected {}", usual.key, value, usual.what);
    for (const LikelyUnit& unit : usual.units)
        if (const double meant = value * unit.size; meant >= usual.low && meant <= usual.high)
            return text + fmt::format("; if it is in {}, write {:g}", unit.name, meant);
    return text;
}

}  // namespace

std::vector<std::string> doubtful_units(const Scene& scene) {
    std::vector<std::string> all;
    for (const Camera& camera : scene.cameras) {
        const auto check = [&](const UsualRange& usual, double value) {
            if (const std::string text = doubt(usual, value); !text.empty())
                all.push_back(fmt::format("camera {}: {}", camera.name, text));
        };
        if (const auto& detector = camera.detector) {
            check(kUsualPitch, detector->pixel_pitch_m);
            check(kUsualStop, detector->f_number);
            check(kUsualExposure, detector->exposure_s);
            check(kUsualWell, detector->full_well_e);
        }
        if (camera.optics.lens) check(kUsualAperture, camera.optics.lens->aperture_diameter_m);
    }
    return all;
}

}  // namespace narpa
