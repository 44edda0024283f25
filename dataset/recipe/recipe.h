/// dataset/recipe/recipe.h - what a data set shows: a scene, one of its cameras, a target, and distributions of
/// what varies from image to image. The key reference is docs/datasets.md.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/vec3.h"
#include "dataset/recipe/distribution.h"

namespace narpa::dataset {

/// A file of each image.
struct OutputKind {
    std::string_view name;       ///< of `outputs`; empty: always written
    std::string_view folder;     ///< within that of the data set
    std::string_view extension;  ///< with its dot
};
/// The images come first, and the labels, whose file completes an image, last.
inline constexpr std::array<OutputKind, 6> kOutputKinds{{
    {"", "images", ".png"},
    {"mask", "masks", ".png"},
    {"depth", "depth", ".pfm"},
    {"normals", "normals", ".pfm"},
    {"radiance", "radiance", ".exr"},
    {"", "labels", ".json"},
}};
inline constexpr std::size_t kImageOutput = 0, kMaskOutput = 1, kDepthOutput = 2, kNormalsOutput = 3,
                             kRadianceOutput = 4, kLabelOutput = 5;
/// By index in kOutputKinds.
using Outputs = std::array<bool, kOutputKinds.size()>;
[[nodiscard]] std::vector<std::string_view> optional_outputs();

/// The target's attitude is uniform over all, or the camera is within a cone about a direction of the target.
struct AttitudeCone {
    Vec3 axis{1, 0, 0};  ///< unit, target axes: from the target to the camera
    double half_angle_rad = 0;
    Vec3 up{0, 0, 1};  ///< target axes: up in the image, as far as possible, if the roll is 0
    Distribution roll_deg = uniform_between(0, 0);  ///< of the camera about its line of sight
};

struct Backdrop {
    enum class Kind : std::uint8_t {
        none,   ///< black: no stars, no sky, no bodies but the target and what is attached to it or the camera
        stars,  ///< the same with the scene's stars
        body,   ///< one body behind the target, with the stars if the scene has any
        scene,  ///< all bodies, the stars and the sky as they are in the scene
    };
    static constexpr std::array<std::string_view, 4> kKindNames{"none", "stars", "body", "scene"};

    Kind kind = Kind::scene;
    double weight = 1;   ///< images are divided in proportion to it
    std::string body{};  ///< kind body
};

/// Other values of keys of the scene.
struct Variant {
    std::string name{};
    double weight = 1;
    std::vector<std::string> sets{};  ///< KEY=VALUE
};

struct Recipe {
    std::string name, file;
    std::string text;                   ///< all that makes it: equal for equal recipes
    std::string scene;                  ///< path
    std::vector<std::string> sets;      ///< KEY=VALUE, of the scene
    std::string camera;                 ///< empty: the first
    std::string target;                 ///< empty: the first body with a mesh that does not carry the camera
    std::vector<std::string> attached;  ///< bodies that keep their pose relative to the target
    std::uint64_t seed = 0;
    Outputs outputs{true, true, true, false, false, true};

    std::optional<Vec3>
        point_m{};  ///< target axes: what range, margin and phase angle refer to; absent: its middle
    std::optional<Distribution> range_m{};  ///< to that point; absent: by the target's size in the image
    std::optional<AttitudeCone> cone{};     ///< absent: uniform over all attitudes
    double margin = 0.1;  ///< the point keeps this part of width and height from the image's border
    std::optional<Distribution> phase_deg{};  ///< Sun, target, camera; absent: the Sun is in any direction
    std::optional<Distribution> time_factor{}, gain_factor{}, albedo_factor{};
    std::vector<Variant> variants{{}};
    std::vector<Backdrop> backdrops{{}};
    int keypoints = 11;               ///< number of them that are chosen on the target
    std::vector<Vec3> keypoints_m{};  ///< target axes, in place of chosen ones
};

/// The tables of a recipe's file.
extern const TableKeys kRecipeFileKeys;

/// Reads a recipe. Errors carry file, line and column; a key that is not known is an error. `overrides`: KEY=VALUE
/// of the recipe's keys or, where it has no such table, of the scene's.
[[nodiscard]] Result<Recipe> read_recipe(const std::string& path, std::span<const std::string> overrides = {});
/// The recipe of a scene alone: all that a recipe may leave out is left out. `overrides`: of the scene.
[[nodiscard]] Recipe recipe_of_scene(const std::string& scene_path, std::span<const std::string> overrides = {});

}  // namespace narpa::dataset
