/// apps/commands/body_views.h - how large and how far the bodies of a scene are for its cameras: a mesh in another
/// unit is a usual mistake.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "emulator/world.h"

namespace narpa::cli {

/// A body as a camera sees it at time 0.
struct BodyView {
    std::size_t body = 0, camera = 0;
    double distance_m = 0;  ///< from the camera to the middle of the body's bounding box
    double size_px = 0;     ///< angle that a sphere about it subtends, half the box's diagonal or an ellipsoid's
                            ///< largest semi-axis in radius, in pixels at the image centre; infinite inside
    bool inside = false;    ///< the camera is inside its surface
};

/// Edges of the bounding box of each body, along its axes.
[[nodiscard]] std::vector<Vec3> body_sizes_m(const Scene& scene, const Tracer& tracer);
/// For each body and each camera that it does not carry.
[[nodiscard]] std::vector<BodyView> body_views(const World& world);

/// Prints sizes and views, and warns of cameras inside bodies and of meshes whose unit is doubtful. Adds `size_m`
/// and `views` to the document's bodies.
void check_body_views(const World& world, nlohmann::json& document);

}  // namespace narpa::cli
