/// renderer/integrator/subpixel_bodies.h - bodies so small in the image that a pixel's few rays would miss them, or
/// overrate them, by chance.
///
/// A sphere of 10 m at 100 km covers 0.014 of a pixel: 64 random samples give its light with 107 % of noise. Such a
/// body is taken out of the camera's regular rays and sampled by rays of its own, over its own outline:
/// renderer/film/subpixel_light.h.
#pragma once

#include <optional>

#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

/// Widest image of a body, across its bounds, that is treated so.
inline constexpr double kSubpixelWidth_px = 2;

/// Where the camera has a point spread function, a sample's light reaches pixels whose middles are closer than this
/// along each axis; else the pixel that it falls on.
inline constexpr double kSpreadSampleReach_px = 2.5;

/// What the camera sees of a tiny body's bounds, in world axes from the camera's centre: points
/// centre + x right + y up with x^2 + y^2 <= 1 are met by every ray that can meet the body.
struct SubpixelDisc {
    std::size_t body = 0;
    Vec3 centre{}, right{}, up{};  ///< metres; `right` is the side that the Sun lights
    double lit = 1;  ///< the Sun can light the part of the disc with x > (1 - 2 lit) sqrt(1 - y^2), were the
                     ///< body its bounds; 1: all of it, or there is no Sun
    double x_px = 0, y_px = 0, radius_px = 0;  ///< circle of the image that holds it, with the lens's blur
};

/// How far from a ball the camera must look for tiles that get light of it, metres: kSpreadSampleReach_px where its
/// image is tiny, else 0. Camera axes.
[[nodiscard]] double spread_reach_m(const CameraModel& model, const Vec3& centre_camera, double radius_m) noexcept;

class SubpixelBodies {
public:
    /// `lens` is null where all is in focus. Finds none where the camera or bodies move within the exposure, and no
    /// body with an atmosphere: the camera's regular rays then sample them. Tracer and poses outlive this.
    SubpixelBodies(const Tracer& tracer, const BodyPoses& at, const Camera& camera, const CameraModelHandle& model,
                   const Rigid3& T_world_camera, const Lens* lens, bool moving);

    /// True where there is any in the image.
    [[nodiscard]] bool any() const noexcept { return any_; }
    [[nodiscard]] bool contains(int body) const noexcept;
    /// The disc of a body, if it is tiny and its circle meets this rectangle of pixels, or comes within the reach
    /// of its samples.
    [[nodiscard]] std::optional<SubpixelDisc> disc_within(int body, int x_first, int y_first, int x_last,
                                                          int y_last) const noexcept;
    /// What the ray meets that is not tiny, given that it first meets `hit`.
    [[nodiscard]] Hit beyond(const Ray& ray, Hit hit) const noexcept;

private:
    /// The atmosphere of a body that rays pass as if it were not there would have no ground.
    [[nodiscard]] bool has_air(std::size_t body) const noexcept;
    [[nodiscard]] Vec3 centre_camera(std::size_t body) const noexcept;
    /// Half the width of the image of a ball of this radius, at its longest, px; infinite where its centre has
    /// none.
    [[nodiscard]] double reach_px(const Vec3& centre_camera, double radius_m) const noexcept;
    void span_disc(SubpixelDisc& disc) const noexcept;

    const Tracer& tracer_;
    const BodyPoses& at_;
    CameraModelHandle model_;
    Rigid3 T_world_camera_;
    const Lens* lens_;
    double sample_reach_px_;
    bool any_ = false;
};

}  // namespace narpa
