/// renderer/geometry/mesh_emission.h - the faces of a mesh that shine.
#pragma once

#include <memory>

#include "renderer/geometry/emissive_surface.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Null where none does. Scene and mesh must outlive it.
[[nodiscard]] std::unique_ptr<const EmissiveSurface> mesh_emission(const Scene& scene, const Mesh& mesh);

}  // namespace narpa
