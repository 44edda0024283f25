#include "renderer/mesh_reader/draco_mesh.h"

#include <draco/compression/decode.h>
#include <fmt/format.h>

#include <array>
#include <utility>

namespace narpa {

DracoMesh::DracoMesh(std::string_view bytes) {
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::Decoder decoder;
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) gltf_fail(fmt::format("a mesh compressed by Draco: {}", decoded.status().error_msg()));
    mesh_ = std::move(decoded).value();
}

DracoMesh::~DracoMesh() = default;

std::vector<std::uint32_t> DracoMesh::indices() const {
    std::vector<std::uint32_t> out;
    out.reserve(3 * mesh_->num_faces());
    for (draco::FaceIndex f(0); f < mesh_->num_faces(); ++f)
        for (const draco::PointIndex& corner : mesh_->face(f)) out.push_back(corner.value());
    return out;
}

GltfValues DracoMesh::attribute(std::int64_t unique_id, bool is_normalised) const {
    const draco::PointAttribute* a = mesh_->GetAttributeByUniqueId(static_cast<std::uint32_t>(unique_id));
    if (a == nullptr || a->num_components() < 1 || a->num_components() > 4)
        gltf_fail(fmt::format("a mesh compressed by Draco has no attribute {} of 1 to 4 numbers", unique_id));
    const auto components = static_cast<std::size_t>(a->num_components());
    GltfValues out{.components = components,
                   .is_float = a->data_type() == draco::DT_FLOAT32,
                   .is_normalised = is_normalised || a->normalized()};
    const std::size_t bytes = static_cast<std::size_t>(draco::DataTypeLength(a->data_type()));
    const bool is_signed = a->data_type() == draco::DT_INT8 || a->data_type() == draco::DT_INT16;
    // draco divides where its own flag is set.
    const double largest = out.is_float || !is_normalised || a->normalized()
                               ? 1
                               : static_cast<double>((std::uint64_t{1} << (8 * bytes - (is_signed ? 1 : 0))) - 1);
    out.values.reserve(mesh_->num_points() * components);
    std::array<float, 4> value{};
    for (draco::PointIndex i(0); i < mesh_->num_points(); ++i) {
        if (!a->ConvertValue(a->mapped_index(i), a->num_components(), value.data()))
            gltf_fail("a mesh compressed by Draco: an attribute cannot be converted");
        for (std::size_t k = 0; k < components; ++k) out.values.push_back(static_cast<double>(value[k]) / largest);
    }
    return out;
}

}  // namespace narpa
