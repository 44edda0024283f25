// Accessors of glTF: typed values in the bytes of buffers.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "renderer/mesh_reader/gltf_file.h"
#include "renderer/mesh_reader/stored_number.h"

namespace narpa {

namespace {

using nlohmann::json;

/// How a component is stored: the `componentType` of accessors.
struct ComponentType {
    std::int64_t code;
    std::size_t size;
    double largest;  ///< of a normalised integer
    double (*read)(const char* bytes);
};

constexpr std::array kComponentTypes{ComponentType{5120, 1, 127, stored_number<std::int8_t>},
                                     ComponentType{5121, 1, 255, stored_number<std::uint8_t>},
                                     ComponentType{5122, 2, 32767, stored_number<std::int16_t>},
                                     ComponentType{5123, 2, 65535, stored_number<std::uint16_t>},
                                     ComponentType{5125, 4, 4294967295.0, stored_number<std::uint32_t>},
                                     ComponentType{5126, 4, 1, stored_number<float>}};
constexpr std::int64_t kFloat = 5126;

const ComponentType& component_type(std::int64_t code) {
    const auto found = std::ranges::find(kComponentTypes, code, &ComponentType::code);
    if (found == kComponentTypes.end())
        gltf_fail(fmt::format("an accessor has components of type {}, expected 5120 to 5123, 5125 or 5126", code));
    return *found;
}

}  // namespace

std::size_t gltf_components(std::string_view type) {
    constexpr std::array<std::pair<std::string_view, std::size_t>, 7> kTypes{
        {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}}};
    for (const auto& [name, components] : kTypes)
        if (name == type) return components;
    gltf_fail(fmt::format("an accessor has the type \"{}\", expected SCALAR, VEC2, VEC3, VEC4 or a matrix", type));
}

void GltfFile::decode(const json& from, std::int64_t type_code, bool is_normalised, std::size_t count,
                      std::size_t components, const char* what, std::vector<double>& out) {
    const ComponentType& type = component_type(type_code);
    const std::int64_t view_index = index_or_none(from, "bufferView");
    const std::string_view bytes = view(view_index);
    const std::size_t element = components * type.size,
                      stride = count_or(item("bufferViews", view_index), "byteStride", element),
                      start = count_or(from, "byteOffset", 0);
    if (stride < element && stride != 0)
        gltf_fail(fmt::format("a byteStride of {}, expected at least {}", stride, element));
    if (count > 0 && (start > bytes.size() || element > bytes.size() - start ||
                      (count - 1) > (bytes.size() - start - element) / std::max<std::size_t>(1, stride)))
        gltf_fail(
            fmt::format("{} of {} elements reach beyond its buffer view of {} bytes", what, count, bytes.size()));
    const double scale = is_normalised && type.code != kFloat ? 1 / type.largest : 1;
    out.resize(count * components);
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t k = 0; k < components; ++k) {
            const double x = scale * type.read(bytes.data() + start + i * stride + k * type.size);
            out[i * components + k] = scale == 1 ? x : std::max(x, -1.0);
        }
}

void GltfFile::apply_sparse(const json& sparse, std::int64_t type_code, GltfValues& out) {
    const std::size_t count = count_or(sparse, "count", 0);
    std::vector<double> indices, values;
    decode(sparse.at("indices"), index_or_none(sparse.at("indices"), "componentType"), false, count, 1,
           "a sparse accessor", indices);
    decode(sparse.at("values"), type_code, out.is_normalised, count, out.components, "a sparse accessor", values);
    for (std::size_t i = 0; i < count; ++i) {
        if (!(indices[i] < static_cast<double>(out.size())))
            gltf_fail(fmt::format("a sparse accessor has index {} of {} elements", indices[i], out.size()));
        std::copy_n(&values[i * out.components], out.components,
                    &out.values[static_cast<std::size_t>(indices[i]) * out.components]);
    }
}

GltfValues GltfFile::accessor(std::int64_t index, std::string_view type, std::string_view also) {
    const json& a = item("accessors", index);
    const std::string given = text_or(a, "type", "");
    if (given != type && (also.empty() || given != also))
        gltf_fail(fmt::format("accessor {} has the type \"{}\", expected {}", index, given, type));
    const std::int64_t type_code = index_or_none(a, "componentType");
    const json* normalised = member(a, "normalized");
    GltfValues out{.components = gltf_components(given),
                   .is_float = type_code == kFloat,
                   .is_normalised = normalised != nullptr && normalised->is_boolean() && normalised->get<bool>()};
    const std::size_t count = count_or(a, "count", 0);
    if (member(a, "bufferView") != nullptr)
        decode(a, type_code, out.is_normalised, count, out.components, "an accessor", out.values);
    else
        out.values.resize(count * out.components);
    if (const json* sparse = member(a, "sparse")) apply_sparse(*sparse, type_code, out);
    return out;
}

}  // namespace narpa
