/// renderer/scene/own_mesh.h - the mesh of one body, to be changed.
#pragma once

#include <cstddef>

#include "renderer/scene/scene.h"

namespace narpa {

/// The body's mesh, first copied if another body has it too; null where its shape is no mesh. A copy moves
/// Scene::meshes.
[[nodiscard]] Mesh* own_mesh(Scene& scene, std::size_t body);

}  // namespace narpa
