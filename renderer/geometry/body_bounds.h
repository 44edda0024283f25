/// renderer/geometry/body_bounds.h - an ellipsoid that holds a body and fits it loosely.
#pragma once

#include "renderer/scene/scene.h"

namespace narpa {

/// In the body's frame, its axes along the body's own.
struct BodyBounds {
    Vec3 centre_m{};
    Vec3 semi_axes_m{1, 1, 1};
};

/// Of a sphere or ellipsoid itself. Of a mesh the ellipsoid in the proportions of its bounding box, about its
/// centre, just large enough for the vertices: for a box its outline is up to 2.4 times as large as the box's own.
/// A flat mesh keeps a thousandth of its largest extent in thickness.
[[nodiscard]] BodyBounds bounds_of(const Scene& scene, const Body& body);

}  // namespace narpa
