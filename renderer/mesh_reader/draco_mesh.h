/// renderer/mesh_reader/draco_mesh.h - compressed meshes in glTF (KHR_draco_mesh_compression), by Google's library.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "renderer/mesh_reader/gltf_file.h"

namespace draco {
class Mesh;
}

namespace narpa {

class DracoMesh {
public:
    /// Throws std::runtime_error.
    explicit DracoMesh(std::string_view bytes);
    ~DracoMesh();
    DracoMesh(const DracoMesh&) = delete;
    DracoMesh& operator=(const DracoMesh&) = delete;

    [[nodiscard]] std::vector<std::uint32_t> indices() const;
    /// The attribute with this number; `is_normalised`: integers are fractions of their largest value.
    [[nodiscard]] GltfValues attribute(std::int64_t unique_id, bool is_normalised) const;

private:
    std::unique_ptr<draco::Mesh> mesh_;
};

}  // namespace narpa
