#include "renderer/scene/own_mesh.h"

#include <algorithm>
#include <utility>
#include <variant>

namespace narpa {

Mesh* own_mesh(Scene& scene, std::size_t body) {
    int* const index = std::get_if<int>(&scene.bodies[body].shape);
    if (index == nullptr) return nullptr;
    const auto has_it = [&](const Body& b) {
        const int* const other = std::get_if<int>(&b.shape);
        return other != nullptr && *other == *index;
    };
    if (std::ranges::count_if(scene.bodies, has_it) > 1) {
        Mesh copy = scene.meshes[static_cast<std::size_t>(*index)];
        *index = static_cast<int>(scene.meshes.size());
        scene.meshes.push_back(std::move(copy));
    }
    return &scene.meshes[static_cast<std::size_t>(*index)];
}

}  // namespace narpa
