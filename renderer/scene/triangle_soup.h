/// renderer/scene/triangle_soup.h - the output of a mesh reader, before vertices are welded and bad triangles
/// dropped.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "renderer/scene/mesh_file.h"

namespace narpa {

struct TriangleSoup {
    static constexpr std::uint32_t kNone = 0xffff'ffffu;
    struct Corner {
        std::uint32_t position = kNone, uv = kNone, normal = kNone;  ///< indices below; kNone where not given
    };
    struct Triangle {
        std::array<Corner, 3> corners;
        std::uint16_t material = 0;
    };
    std::vector<Vec3> positions;  ///< in the file's unit
    std::vector<Vec3f> normals;   ///< of any length
    std::vector<std::array<float, 2>> uvs;
    std::vector<Triangle> triangles;
    std::vector<MeshMaterial> materials;
    std::vector<std::string> warnings;
};

/// Most materials of a mesh.
inline constexpr std::size_t kMaxMaterials = 65535;

Result<TriangleSoup> read_soup_with_assimp(const std::string& path);

/// In small letters, with its dot: ".obj".
std::string extension_of(const std::string& path);

/// The file that a material names, looked for as written and then by its last part beside the mesh.
std::string texture_path(const std::string& mesh_path, std::string name);

}  // namespace narpa
