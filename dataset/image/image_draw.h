/// dataset/image/image_draw.h - what is drawn for one image.
#pragma once

#include <cstdint>
#include <optional>

#include "base/pose.h"
#include "dataset/recipe/recipe.h"
#include "renderer/scene/camera.h"

namespace narpa::dataset {

/// What the distributions need to know of the scene.
struct SceneFacts {
    const Camera* camera = nullptr;       ///< never null
    Vec3 point_m{};                       ///< target axes: Recipe::point_m, or the target's middle
    double target_radius_m = 1;           ///< of a sphere about the target's middle that holds it
    std::optional<Vec3> sun_world{};      ///< unit, towards the Sun
    std::optional<Distribution> range_m;  ///< the recipe's, or by the target's size in the image
};

/// Camera axes: x right, y down, z forward.
struct ImageDraw {
    std::size_t variant = 0, backdrop = 0;  ///< indices in the recipe
    Rigid3 T_camera_target{};
    Quat q_world_camera{};           ///< in a scene with a Sun: has the drawn phase angle
    std::optional<Vec3> sun_camera;  ///< unit, towards the Sun
    double range_m = 0;              ///< to SceneFacts::point_m
    double phase_rad = 0;            ///< at that point, between camera and Sun; 0 without a Sun
    double time_factor = 1, gain_factor = 1, albedo_factor = 1;
    Vec3 backdrop_offset{};   ///< uniform in a disc of radius 1 (x, y): of a body behind the target
    Quat q_world_backdrop{};  ///< uniform over all attitudes
};

/// A range such that a sphere that holds the target has 90 % to 15 % of the image's smaller side as its diameter,
/// log-uniform.
[[nodiscard]] Distribution default_range_m(const Camera& camera, double target_radius_m);

/// The draw of an image: the same for the same recipe, seed, scene and image number.
[[nodiscard]] ImageDraw draw_image(const Recipe& recipe, const SceneFacts& facts, std::uint32_t image);

/// Uniform over all attitudes, for three independent uniform numbers in [0, 1) (K. Shoemake, "Uniform random
/// rotations", Graphics Gems III, 1992).
[[nodiscard]] Quat uniform_attitude(double u1, double u2, double u3);
/// The shortest rotation that turns the unit vector `from` to `to`.
[[nodiscard]] Quat shortest_rotation(const Vec3& from, const Vec3& to);

}  // namespace narpa::dataset
