/// renderer/camera/lens.h - a thin lens: what is not at the focus distance is blurred.
///
/// 1/f = 1/image + 1/focus (Gauss); distances from the lens along its axis enter as their inverses, so that
/// infinity is the number 0. f is the focal length of the glass, less than every focus distance. A camera's fx, fy
/// are the image distance in pixels, as a calibration at that focus finds them: they do not change with the focus
/// here.
#pragma once

#include <cmath>
#include <limits>

#include "renderer/camera/camera_ray.h"
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

/// The same in pixels, of a point at this depth along the camera's z axis; `focal_px` is the camera's fx or fy.
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

/// The ray from this point of the aperture to where the pinhole's ray through image point (x, y) meets the plane of
/// focus.
[[nodiscard]] inline Ray lens_ray(const Camera& c, const Lens& lens, const Rigid3& T_world_camera, double x,
                                  double y, const Vec3& from) {
    const Vec3 pinhole{(x - c.cx) / c.fx, (y - c.cy) / c.fy, 1.0};
    return {T_world_camera * from, T_world_camera.q * normalized(pinhole - from / lens.focus_distance_m)};
}

/// The image point that a ray from this point of the aperture in this direction (camera axes, z > 0) comes to lie
/// on: the inverse of the above.
[[nodiscard]] inline std::array<double, 2> image_point(const Camera& c, const Lens& lens, const Vec3& from,
                                                       const Vec3& direction_camera) {
    return image_point(c, direction_camera / direction_camera.z + from / lens.focus_distance_m);
}

}  // namespace narpa
