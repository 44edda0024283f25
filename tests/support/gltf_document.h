/// tests/support/gltf_document.h - glTF documents written value by value.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/text/base64.h"
#include "tests/support/image_bytes.h"

namespace narpa::test {

struct GltfAccessor {
    std::string type = "VEC3";
    int component = 5126;  ///< the specification's code of the component type
    bool is_normalised = false;
    int padding = 0;         ///< bytes between elements
    int offset = 0;          ///< bytes before the first, in the buffer view
    bool is_sparse = false;  ///< the values replace zeros
};

/// One scene; a buffer for all accessors.
class GltfDocument {
public:
    nlohmann::json root = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}};

    static int size_of(int component) { return component <= 5121 ? 1 : component <= 5123 ? 2 : 4; }
    /// Full scale of normalised integers.
    static double largest(int component) {
        const int bits = 8 * size_of(component) - (component == 5120 || component == 5122 ? 1 : 0);
        return component == 5126 ? 1 : std::pow(2.0, bits) - 1;
    }

    /// Stores `codes`: what is in the file, before it is normalised. Returns the accessor's index.
    int add(const std::vector<double>& codes, const GltfAccessor& how = {}) {
        const int components = how.type == "SCALAR" ? 1 : how.type == "MAT4" ? 16 : how.type[3] - '0';
        const int size = size_of(how.component), element = components * size;
        const std::size_t count = codes.size() / static_cast<std::size_t>(components);
        nlohmann::json accessor = {{"componentType", how.component}, {"count", count}, {"type", how.type}};
        if (how.is_normalised) accessor["normalized"] = true;
        std::string bytes(static_cast<std::size_t>(how.is_sparse ? 0 : how.offset), '\x5a');
        for (std::size_t i = 0; i < codes.size(); ++i) {
            bytes += how.component == 5126
                         ? bytes_of(std::bit_cast<std::uint32_t>(static_cast<float>(codes[i])), 4, false)
                         : bytes_of(static_cast<std::uint64_t>(static_cast<std::int64_t>(codes[i])), size, false);
            if ((i + 1) % static_cast<std::size_t>(components) == 0 && !how.is_sparse)
                bytes.append(static_cast<std::size_t>(how.padding), '\x5a');
        }
        const int view = add_view(bytes, how.padding > 0 && !how.is_sparse ? element + how.padding : 0);
        if (how.is_sparse) {
            std::string indices;
            for (std::size_t i = 0; i < count; ++i) indices += bytes_of(i, 4, false);
            accessor["sparse"] = {{"count", count},
                                  {"indices", {{"bufferView", add_view(indices, 0)}, {"componentType", 5125}}},
                                  {"values", {{"bufferView", view}}}};
        } else {
            accessor["bufferView"] = view;
            if (how.offset > 0) accessor["byteOffset"] = how.offset;
        }
        root["accessors"].push_back(accessor);
        return static_cast<int>(root["accessors"].size()) - 1;
    }

    int add_view(const std::string& bytes, int stride) {
        while (buffer.size() % 4 != 0) buffer += '\x5a';
        nlohmann::json view = {{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}};
        if (stride > 0) view["byteStride"] = stride;
        buffer += bytes;
        root["bufferViews"].push_back(view);
        return static_cast<int>(root["bufferViews"].size()) - 1;
    }

    /// With the buffer inside, in Base64.
    [[nodiscard]] std::string text() const {
        return with_uri("data:application/octet-stream;base64," + base64(buffer));
    }
    /// With the buffer elsewhere.
    [[nodiscard]] std::string with_uri(const std::string& uri) const {
        nlohmann::json out = root;
        out["buffers"] = {{{"byteLength", buffer.size()}, {"uri", uri}}};
        return out.dump();
    }
    /// As .glb.
    [[nodiscard]] std::string binary() const {
        nlohmann::json out = root;
        out["buffers"] = {{{"byteLength", buffer.size()}}};
        std::string json = out.dump(), bytes = buffer;
        while (json.size() % 4 != 0) json += ' ';
        while (bytes.size() % 4 != 0) bytes += '\0';
        return "glTF" + bytes_of(2, 4, false) + bytes_of(28 + json.size() + bytes.size(), 4, false) +
               bytes_of(json.size(), 4, false) + "JSON" + json + bytes_of(bytes.size(), 4, false) +
               std::string("BIN\0", 4) + bytes;
    }

    std::string buffer;
};

/// A triangle at (0 0 0), (1 0 0), (0 1 0) of node 0, with `primitive` and `document` merged in.
inline GltfDocument gltf_triangle(const nlohmann::json& primitive = {}, const nlohmann::json& document = {}) {
    GltfDocument d;
    nlohmann::json p = {{"attributes", {{"POSITION", d.add({0, 0, 0, 1, 0, 0, 0, 1, 0})}}}};
    if (!primitive.is_null()) p.merge_patch(primitive);
    d.root["nodes"] = {{{"mesh", 0}}};
    d.root["meshes"] = {{{"primitives", {p}}}};
    if (!document.is_null()) d.root.merge_patch(document);
    return d;
}

}  // namespace narpa::test
