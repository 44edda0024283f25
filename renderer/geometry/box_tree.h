/// renderer/geometry/box_tree.h - boxes about the parts of a mesh, from one about all of it down to a few thousand.
#pragma once

#include <vector>

#include "renderer/geometry/shape.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Root first, every node before its children; empty for a mesh without faces. Each triangle, to rounding in single
/// precision, lies in the union of the leaves, in pieces where it is large: a box about a whole panel that stands
/// askew would hold mostly nothing. Boxes are cut one at a time, the one with the largest surface first, where the
/// surfaces of the halves weigh least (J. Goldsmith, J. Salmon, "Automatic creation of object hierarchies for ray
/// tracing", IEEE CG&A 7(5), 1987), so that the leaves are of like size.
[[nodiscard]] std::vector<BoxNode> box_tree(const Mesh& mesh);

}  // namespace narpa
