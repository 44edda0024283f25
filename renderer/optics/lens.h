/// renderer/optics/lens.h - a thin lens in front of any camera model: depth of field.
///
/// 1/f = 1/image + 1/focus (Gauss). Distances along the axis enter as their inverses, so that infinity is 0. f is
/// the focal length of the glass, less than every focus distance. The camera model is that of the chief rays, as a
/// calibration at this focus finds it: it does not change with the focus.
#pragma once

#include <cmath>

#include "base/concentric_disc.h"
#include "base/vec3.h"
#include "renderer/optics/optical_effect.h"

namespace narpa {

extern const OpticsKind kThinLens;

/// Diameter of the blurred image of a point at this depth along the camera's z axis: the circle of confusion, px.
/// `focal_px`: px per unit of the plane z = 1.
[[nodiscard]] inline double circle_of_confusion_px(const Lens& lens, double focal_px, double depth_m) {
    return lens.aperture_diameter_m * focal_px * std::abs(1 / lens.focus_distance_m - 1 / depth_m);
}

/// Point of the aperture for (u, v) in [0, 1)^2, uniform in area; camera axes, metres.
[[nodiscard]] inline Vec3 aperture_point(const Lens& lens, double u, double v) {
    const auto [x, y] = concentric_disc(u, v);
    const double radius_m = 0.5 * lens.aperture_diameter_m;
    return {radius_m * x, radius_m * y, 0};
}

/// Direction, in camera axes, from a point of the aperture to where the chief ray (through the lens's centre) meets
/// the plane of focus. `chief`: any length, z > 0.
[[nodiscard]] inline Vec3 lens_direction(const Lens& lens, const Vec3& chief, const Vec3& from) {
    return normalized(chief / chief.z - from / lens.focus_distance_m);
}
/// Inverse of lens_direction: the chief ray, with z = 1, that meets the ray from this point of the aperture in the
/// plane of focus.
[[nodiscard]] inline Vec3 chief_direction(const Lens& lens, const Vec3& direction, const Vec3& from) {
    return direction / direction.z + from / lens.focus_distance_m;
}

}  // namespace narpa
