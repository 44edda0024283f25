#include "renderer/mesh_reader/mesh_reader.h"

#include <fmt/format.h>

#include <exception>

namespace narpa {

MeshMessage read_mesh_file(const std::string& path) {
    const std::string extension = extension_of(path);
    try {
        if (extension == ".gltf" || extension == ".glb") return read_gltf(path);
        if (extension == ".ply") return read_ply(path);
        if (extension == ".stl") return read_stl(path);
        return read_with_assimp(path);
    } catch (const std::exception& e) {
        return {.error = fmt::format("not a mesh that can be read: {}", e.what())};
    }
}

}  // namespace narpa
