/// renderer/mesh_reader/gltf_primitive.h - attributes and indices of a glTF primitive, plain or compressed by
/// Draco. Functions throw std::runtime_error.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "renderer/mesh_reader/draco_mesh.h"
#include "renderer/mesh_reader/gltf_file.h"

namespace narpa {

class GltfPrimitive {
public:
    GltfPrimitive(GltfFile& file, const nlohmann::json& description);

    [[nodiscard]] const nlohmann::json& description() const { return description_; }
    [[nodiscard]] bool is_compressed() const { return draco_.has_value(); }
    [[nodiscard]] bool has(const std::string& name) const;
    /// Call this first: other attributes must have as many values.
    [[nodiscard]] GltfValues positions();
    /// Types as for GltfFile::accessor; nullopt if the primitive does not have it.
    [[nodiscard]] std::optional<GltfValues> attribute(const std::string& name, std::string_view type,
                                                      std::string_view also = {});
    /// The same values. Throws where there are not as many as positions.
    [[nodiscard]] GltfValues checked(std::string_view name, GltfValues values) const;
    /// Each below the number of positions; counts up where the file gives none.
    [[nodiscard]] std::vector<std::uint32_t> indices();

private:
    GltfFile& file_;
    const nlohmann::json& description_;
    const nlohmann::json* draco_attributes_ = nullptr;
    std::optional<DracoMesh> draco_;
    std::size_t vertices_ = 0;
};

}  // namespace narpa
