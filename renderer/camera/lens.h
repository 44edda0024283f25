/// renderer/camera/lens.h - a thin lens in front of any camera model: depth of field.
///
/// 1/f = 1/image + 1/focus (Gauss). Distances along the axis enter as their inverses, so that infinity is 0. f is
/// the focal length of the glass, less than every focus distance. The camera model is that of the chief rays, as a
/// calibration at this focus finds it: it does not change with the focus.
#pragma once

#include <cmath>
#include <limits>

#include "renderer/camera/camera_model.h"
#include "renderer/light/concentric_disc.h"

namespace narpa {

/// Distance from the lens to the image plane on which the focus distance is sharp, metres.
[[nodiscard]] inline double image_distance_m(double focal_length_m, double inverse_focus_per_m) {
    return focal_length_m / (1 - focal_length_m * inverse_focus_per_m);
}

/// Diameter on the image plane of the blurred image of a point: the circle of confusion, metres.
[[nodiscard]] inline double circle_of_confusion_m(double focal_length_m, double aperture_diameter_m,
                                                  double inverse_focus_per_m, double inverse_depth_per_m) {
    return aperture_diameter_m * image_distance_m(focal_length_m, inverse_focus_per_m) *
           std::abs(inverse_focus_per_m - inverse_depth_per_m);
}

/// The same in pixels, of a point at this depth along the camera's z axis; `focal_px`: px per unit of the plane z
/// = 1.
[[nodiscard]] inline double circle_of_confusion_px(const Lens& lens, double focal_px, double depth_m) {
    return lens.aperture_diameter_m * focal_px * std::abs(1 / lens.focus_distance_m - 1 / depth_m);
}

/// Where a ray passes the lens: the point of the aperture for (u, v) in [0, 1)^2, even in area; camera axes,
/// metres.
[[nodiscard]] inline Vec3 aperture_point(const Lens& lens, double u, double v) {
    const auto [x, y] = concentric_disc(u, v);
    const double radius_m = 0.5 * lens.aperture_diameter_m;
    return {radius_m * x, radius_m * y, 0};
}

/// Direction, in camera axes, from a point of the aperture to where the chief ray, that through the lens's centre,
/// meets the plane of focus. `chief`: any length, z > 0.
[[nodiscard]] inline Vec3 lens_direction(const Lens& lens, const Vec3& chief, const Vec3& from) {
    return normalized(chief / chief.z - from / lens.focus_distance_m);
}
/// The chief ray that meets a ray from this point of the aperture in the plane of focus: the inverse, of z = 1.
[[nodiscard]] inline Vec3 chief_direction(const Lens& lens, const Vec3& direction, const Vec3& from) {
    return direction / direction.z + from / lens.focus_distance_m;
}

/// The ray from a point of the aperture that is focused on image point (x, y), world axes.
[[nodiscard]] inline Ray lens_ray(const CameraModelHandle& model, const Lens& lens, const Rigid3& T_world_camera,
                                  double x, double y, const Vec3& from) {
    return {T_world_camera * from, T_world_camera.q * lens_direction(lens, model->direction({x, y}), from)};
}

}  // namespace narpa
