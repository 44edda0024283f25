/// renderer/mesh_reader/mesh_reader.h - mesh files -> triangles and materials: what the program narpa-mesh-reader
/// does. Damaged files crash Assimp 5.2, or keep it busy for minutes.
///
/// Own readers for glTF, PLY and STL, as Assimp 5.2 reads normalised integers as such, and passes over required
/// extensions, strips, instances and colours without a word; 3DS, DAE and glTF 1 by Assimp.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/assets/meshes/mesh_message.h"

struct aiMaterial;
struct aiScene;

namespace narpa {

/// By the reader for the file's extension, whatever the file begins with.
MeshMessage read_mesh_file(const std::string& path);

/// These may throw std::exception.
MeshMessage read_gltf(const std::string& path);
MeshMessage read_ply(const std::string& path);
MeshMessage read_stl(const std::string& path);
MeshMessage read_with_assimp(const std::string& path);

/// The material of a file that gives none: grey 0.5, Lambert.
[[nodiscard]] inline PlainMaterial grey_material() {
    return {.numbers = {.diffuse = {0.5f, 0.5f, 0.5f}, .is_grey_by_default = true}, .name = {}};
}

/// A material that Assimp read from the file `path`. `warnings` gets what is left out.
PlainMaterial from_assimp(const aiScene& scene, const aiMaterial& m, const std::string& path,
                          std::vector<std::string>& warnings);

}  // namespace narpa
