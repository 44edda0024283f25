#include "renderer/optics/lens.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/constants.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/projection/camera_model.h"

namespace narpa {
namespace {

constexpr TableKey kLensRows[]{
    {"aperture_diameter_m", rows::number(kPositive)},
    {"focal_length_m", rows::number(kPositive)},
    {"f_number", rows::number(kPositive)},
    {"focus_distance_m", rows::number({.low = 0, .low_open = true, .infinite = true}), "a number > 0, or inf"},
};
constexpr TableKeys kLensKeys{.rows = kLensRows};
constexpr TableKey kLensOfCamera[]{{"lens", rows::table(kLensKeys)}};

/// Refuses thin lenses with a wide field: rays at right angles to the axis do not meet the plane of focus.
void refuse_wide_field(TableReader& camera, const ImagePlane& plane) {
    constexpr double kWidest_deg = 80;
    const DirectionCone field = plane.model->bounds({-0.5, -0.5, plane.width - 0.5, plane.height - 0.5});
    const double off_axis_deg = (std::acos(std::clamp(field.axis.z, -1.0, 1.0)) + field.half_angle_rad) * 180 / kPi;
    if (off_axis_deg > kWidest_deg)
        camera.fail("lens",
                    fmt::format("the image reaches {:.0f} degrees off the axis, expected at most {:g} for a "
                                "thin lens",
                                off_axis_deg, kWidest_deg));
}

/// Thin lens, by the diameter of its aperture, or by its focal length and the camera's f-number. If only the lens
/// states the f-number, the detector takes it.
void read_lens(TableReader& camera, const OpticsContext& context, Optics& optics) {
    auto table = camera.table("lens");
    if (!table) return;
    Lens lens;
    table->read("aperture_diameter_m", lens.aperture_diameter_m);
    const auto focal_length = table->number("focal_length_m");
    auto f_number = table->number("f_number");
    Detector* const detector = context.detector;
    const bool detector_has_one = detector != nullptr && camera.table("detector")->has("f_number");
    if (table->has("aperture_diameter_m")) {
        for (const char* key : {"focal_length_m", "f_number"})
            table->refuse(key, "there is an aperture_diameter_m already, expected one of the two");
    } else if (!table->has("focal_length_m") && !table->has("f_number")) {
        table->require("aperture_diameter_m", "a number > 0, or focal_length_m and f_number");
    } else {
        table->require("focal_length_m", "a number > 0, as there is an f_number");
        if (!detector_has_one) table->require("f_number", "a number > 0, here or in the detector");
    }
    if (f_number && detector_has_one && *f_number != detector->f_number)
        table->fail("f_number",
                    fmt::format("the detector's is {}, expected the same: a camera has one", detector->f_number));
    if (f_number && detector) detector->f_number = *f_number;
    if (!f_number && detector_has_one) f_number = detector->f_number;
    if (focal_length && f_number) lens.aperture_diameter_m = *focal_length / *f_number;
    lens.focus_distance_m = table->number("focus_distance_m").value_or(1);
    if (focal_length && table->has("focus_distance_m") && lens.focus_distance_m <= *focal_length)
        table->fail("focus_distance_m", fmt::format("got {}, expected more than the focal length of {} m",
                                                    lens.focus_distance_m, *focal_length));
    table->finish();
    refuse_wide_field(camera, context.plane);
    optics.lens = lens;
}

}  // namespace

constinit const OpticsKind kThinLens{kLensOfCamera, read_lens};

}  // namespace narpa
