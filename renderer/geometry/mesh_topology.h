/// renderer/geometry/mesh_topology.h - is a mesh a closed surface?
#pragma once

#include "renderer/scene/scene.h"

namespace narpa {

/// Every edge is passed as often in one direction as in the other, with vertices identified by position alone: a
/// ray that meets the mesh from outside meets its outer side first. Several shells may be closed together.
[[nodiscard]] bool is_closed(const Mesh& mesh);

}  // namespace narpa
