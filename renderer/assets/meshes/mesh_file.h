/// renderer/assets/meshes/mesh_file.h - mesh files -> triangles: OBJ, ICQ and tables of plates here, others in a
/// process of their own (mesh_process.h).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Of narpa-mesh-reader, the process that reads glTF, PLY, STL, 3DS and DAE, for files below 512 MiB; larger ones
/// have as much again for each further 512 MiB.
struct MeshReaderLimits {
    std::uint64_t memory_bytes = std::uint64_t{4} << 30;  ///< of the process, and of the data that it sends
    int seconds = 60;                                     ///< wall time
};

/// An image that a mesh file's material names: not read yet.
struct MeshTexture {
    std::string file{};                 ///< full path, or a name for what the mesh file holds itself; empty: none
    std::vector<std::uint8_t> bytes{};  ///< the encoded image, where the mesh file holds it
    Texture::Wrap wrap = Texture::Wrap::repeat;

    [[nodiscard]] bool named() const { return !file.empty(); }
};

/// A material as a mesh file gives it.
struct MeshMaterial {
    Material material;
    bool is_grey_by_default = false;  ///< the file gives no diffuse colour: vertex colours replace it
    MeshTexture colour{}, emission{}, normal{};
    MeshTexture bump{};                      ///< MTL's: a normal map or a height map, decided by its image
    std::optional<float> bump_multiplier{};  ///< MTL's -bm
    [[nodiscard]] bool has_textures() const {
        return colour.named() || emission.named() || normal.named() || bump.named();
    }
};

/// One mesh file in the body's frame.
struct MeshFile {
    Mesh mesh;  ///< face_material is an index into `materials`
    std::vector<MeshMaterial> materials;
    std::size_t degenerate = 0, duplicate = 0, non_finite = 0;  ///< triangles dropped, also in `warnings`
    std::vector<std::string> warnings;
};

/// Largest coordinate of a mesh, either way, as that of the exact shapes: beyond 1.8e18 m Embree drops triangles.
inline constexpr float kMeshReach_m = 1e15f;

/// Reads OBJ + MTL (.obj, .tab), glTF, PLY, STL, 3DS and DAE; `scale` turns the file's unit into metres and is
/// applied in double. Node transforms are applied. Faces are triangulated; points and lines are left out. Normals
/// are kept where the file gives them. Of a file without, `crease_rad` smooths the edges between triangles that
/// are turned against each other by less than that (smooth_normals.h); 0: none. Dropped and counted: triangles with
/// a coordinate that is not finite, triangles whose height is below 2^-24 of their longest side (float cannot hold
/// their normal), and second copies of a triangle, whichever way round. Errors name the mesh file, and the line
/// where it is an OBJ; a mesh beyond kMeshReach_m is one.
Result<MeshFile> read_mesh(const std::string& path, double scale, double crease_rad = 0,
                           const MeshReaderLimits& limits = {});

}  // namespace narpa
