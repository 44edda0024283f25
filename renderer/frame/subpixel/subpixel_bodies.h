/// renderer/frame/subpixel/subpixel_bodies.h - bodies so small in the image that a pixel's few rays would miss or
/// overweight them by chance.
///
/// A sphere of 10 m at 100 km covers 0.014 of a pixel: 64 random samples estimate its light with 107 % noise. Such
/// a body is excluded from the camera's regular rays and sampled by separate rays over its own outline:
/// renderer/frame/subpixel/subpixel_light.h.
#pragma once

#include <optional>

#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

/// Bodies whose bounds are narrower than this in the image are subpixel bodies.
inline constexpr double kSubpixelWidth_px = 2;

/// With a point spread function, a sample's light reaches pixels whose centres are closer than this along each
/// axis; without, only the pixel that it falls on.
inline constexpr double kSpreadSampleReach_px = 2.5;

/// The outline of a subpixel body's bounds as seen by the camera, in world axes relative to the camera's centre:
/// every ray that can meet the body passes a point centre + x right + y up with x^2 + y^2 <= 1.
struct SubpixelDisc {
    std::size_t body = 0;
    Vec3 centre{}, right{}, up{};  ///< metres; `right` is the side that the Sun lights
    double lit = 1;  ///< the Sun can light the part of the disc with x > (1 - 2 lit) sqrt(1 - y^2), if the body
                     ///< fills its bounds; 1: all of it, or there is no Sun
    double x_px = 0, y_px = 0, radius_px = 0;  ///< bounding circle in the image, including the lens's blur
};

/// Distance from a ball within which tiles may receive its light, metres: kSpreadSampleReach_px if its image is
/// subpixel, else 0. Camera axes.
[[nodiscard]] double spread_reach_m(const CameraModel& model, const Vec3& centre_camera, double radius_m) noexcept;

class SubpixelBodies {
public:
    /// `lens`: null if all is in focus. Finds none if the camera or bodies move within the exposure, and never a
    /// body with an atmosphere: the camera's regular rays then sample them. Tracer and poses outlive this.
    SubpixelBodies(const Tracer& tracer, const BodyPoses& at, const Camera& camera, const CameraModel* model,
                   const Rigid3& T_world_camera, const Lens* lens, bool moving);

    /// True if there is any in the image.
    [[nodiscard]] bool any() const noexcept { return any_; }
    [[nodiscard]] bool contains(int body) const noexcept;
    /// The disc of a body, if it is a subpixel body and its circle meets this rectangle of pixels, or comes within
    /// the reach of its samples.
    [[nodiscard]] std::optional<SubpixelDisc> disc_within(int body, int x_first, int y_first, int x_last,
                                                          int y_last) const noexcept;
    /// The first hit that is not on a subpixel body, given the first hit `hit`.
    [[nodiscard]] Hit beyond(const Ray& ray, Hit hit) const noexcept;

private:
    /// Bodies with an atmosphere are excluded: if rays passed through the body, its atmosphere would have no
    /// ground.
    [[nodiscard]] bool has_air(std::size_t body) const noexcept;
    [[nodiscard]] Vec3 centre_camera(std::size_t body) const noexcept;
    /// Largest half width of the image of a ball of this radius, px; infinite if its centre has no image.
    [[nodiscard]] double reach_px(const Vec3& centre_camera, double radius_m) const noexcept;
    void span_disc(SubpixelDisc& disc) const noexcept;

    const Tracer& tracer_;
    const BodyPoses& at_;
    const CameraModel* model_;
    Rigid3 T_world_camera_;
    const Lens* lens_;
    double sample_reach_px_;
    bool any_ = false;
};

}  // namespace narpa
