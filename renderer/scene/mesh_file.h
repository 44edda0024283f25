/// renderer/scene/mesh_file.h - mesh files -> triangles, by Assimp, and OBJ by our own reader (obj_file.h says
/// why).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// A material as a mesh file gives it: its texture is named, not read.
struct MeshMaterial {
    Material material;
    std::string texture_file{};                 ///< full path; empty: none, or held in the file itself
    std::vector<std::uint8_t> texture_bytes{};  ///< an encoded image that the mesh file holds
};

/// One mesh file in the body's frame.
struct MeshFile {
    Mesh mesh;  ///< face_material is an index into `materials`
    std::vector<MeshMaterial> materials;
    std::size_t degenerate = 0, duplicate = 0, non_finite = 0;  ///< triangles dropped, also told in `warnings`
    std::vector<std::string> warnings;
};

/// Reads OBJ + MTL, glTF, PLY, STL, 3DS, DAE and what else Assimp knows; `scale` turns the file's unit into metres
/// and is applied in double. Node transforms are applied. Faces are triangulated; points and lines are left out.
/// Normals are kept where the file gives them, and never made up. Dropped and counted: triangles with a coordinate
/// that is not finite, triangles whose height is below 2^-24 of their longest side (float cannot hold their
/// normal), and second copies of a triangle, whichever way round. Errors name the mesh file, and the line where it
/// is an OBJ.
Result<MeshFile> read_mesh(const std::string& path, double scale);

}  // namespace narpa
