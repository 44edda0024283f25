#include "renderer/mesh_reader/gltf_primitive.h"

#include <fmt/format.h>

#include <cmath>

namespace narpa {

using nlohmann::json;

GltfPrimitive::GltfPrimitive(GltfFile& file, const json& description) : file_(file), description_(description) {
    if (const json* draco = extension_of_object(description, "KHR_draco_mesh_compression")) {
        draco_attributes_ = &draco->at("attributes");
        draco_.emplace(file.view(index_or_none(*draco, "bufferView")));
    }
}

bool GltfPrimitive::has(const std::string& name) const {
    return member(description_.at("attributes"), name.c_str()) != nullptr;
}

GltfValues GltfPrimitive::positions() {
    std::optional<GltfValues> out = attribute("POSITION", "VEC3");
    if (!out) gltf_fail("a primitive has no POSITION");
    vertices_ = out->size();
    return *std::move(out);
}

std::optional<GltfValues> GltfPrimitive::attribute(const std::string& name, std::string_view type,
                                                   std::string_view also) {
    const std::int64_t accessor = index_or_none(description_.at("attributes"), name.c_str());
    if (accessor < 0) return std::nullopt;
    const std::int64_t compressed = draco_ ? index_or_none(*draco_attributes_, name.c_str()) : -1;
    GltfValues values;
    if (compressed >= 0) {
        const json* normalised = member(file_.item("accessors", accessor), "normalized");
        values = draco_->attribute(compressed, normalised != nullptr && *normalised == true);
        if (values.components != gltf_components(type) &&
            (also.empty() || values.components != gltf_components(also)))
            gltf_fail(fmt::format("{} has {} numbers a vertex, expected {}", name, values.components, type));
    } else {
        values = file_.accessor(accessor, type, also);
    }
    return name == "POSITION" ? values : checked(name, std::move(values));
}

GltfValues GltfPrimitive::checked(std::string_view name, GltfValues values) const {
    if (values.size() != vertices_)
        gltf_fail(fmt::format("{} values of {} for {} vertices", values.size(), name, vertices_));
    return values;
}

std::vector<std::uint32_t> GltfPrimitive::indices() {
    if (draco_) return draco_->indices();
    std::vector<std::uint32_t> out;
    const std::int64_t accessor = index_or_none(description_, "indices");
    if (accessor < 0) {
        for (std::size_t i = 0; i < vertices_; ++i) out.push_back(static_cast<std::uint32_t>(i));
        return out;
    }
    const GltfValues given = file_.accessor(accessor, "SCALAR");
    out.reserve(given.size());
    for (const double index : given.values) {
        if (!(index >= 0 && index < static_cast<double>(vertices_)) || index != std::floor(index))
            gltf_fail(fmt::format("a primitive has index {}, counted from 0, of {} vertices", index, vertices_));
        out.push_back(static_cast<std::uint32_t>(index));
    }
    return out;
}

}  // namespace narpa
