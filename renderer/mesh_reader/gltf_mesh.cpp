// Meshes of glTF: primitives of all nodes of the scene, with morph targets, skins and instances as the file stores
// them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "renderer/mesh_reader/gltf_material.h"
#include "renderer/mesh_reader/gltf_nodes.h"
#include "renderer/mesh_reader/gltf_primitive.h"
#include "renderer/mesh_reader/mesh_reader.h"

namespace narpa {

namespace {

using nlohmann::json;

Vec3 vec3_at(const GltfValues& values, std::size_t i) {
    const double* v = values[i];
    return {v[0], v[1], v[2]};
}

/// Vertices of one primitive in the frame of its mesh.
struct Vertices {
    std::vector<Vec3> positions{}, normals{};
    std::vector<std::array<float, 2>> uvs{};
    std::vector<Rgb> colours{};
    std::vector<Affine> joints{};  ///< of each vertex, to the file's frame; empty: without a skin
};

/// Indices of triangles, from a list, a strip or a fan of `n` vertices.
std::vector<std::array<std::size_t, 3>> triangles_of(std::int64_t mode, std::size_t n) {
    constexpr std::int64_t kStrip = 5, kFan = 6;
    std::vector<std::array<std::size_t, 3>> out;
    if (mode == kStrip)
        for (std::size_t i = 0; i + 2 < n; ++i) out.push_back({i, i + 1 + i % 2, i + 2 - i % 2});
    else if (mode == kFan)
        for (std::size_t i = 1; i + 1 < n; ++i) out.push_back({0, i, i + 1});
    else
        for (std::size_t i = 0; i + 2 < n; i += 3) out.push_back({i, i + 1, i + 2});
    return out;
}

class MeshWalk {
public:
    explicit MeshWalk(GltfFile& file) : file_(file), nodes_(file) {}

    MeshMessage read() {
        for (const std::int64_t node : nodes_.shown()) read_node(node);
        if (const json* all = member(file_.root(), "animations"); all != nullptr && !all->empty())
            file_.warn("animations are not used: nodes are as they are stored");
        if (not_triangles_ > 0)
            file_.warn(fmt::format("{} primitives of points or lines are not used", not_triangles_));
        soup_.warnings = file_.warnings;
        return {.soup = std::move(soup_), .materials = std::move(materials_)};
    }

private:
    void read_node(std::int64_t index) {
        const json& node = file_.item("nodes", index);
        const std::int64_t mesh_index = index_or_none(node, "mesh");
        if (mesh_index < 0) return;
        const json& mesh = file_.item("meshes", mesh_index);
        const std::int64_t skin = index_or_none(node, "skin");
        const std::vector<Affine> places = skin >= 0 ? std::vector<Affine>{Affine{}} : places_of(node, index);
        for (const json& primitive : mesh.at("primitives"))
            read_primitive(primitive, weights_of(node, mesh), skin, places);
    }

    /// One, or those of EXT_mesh_gpu_instancing.
    std::vector<Affine> places_of(const json& node, std::int64_t index) {
        const Affine& world = nodes_.world(index);
        const json* instancing = extension_of_object(node, "EXT_mesh_gpu_instancing");
        if (instancing == nullptr) return {world};
        const json& attributes = instancing->at("attributes");
        const auto given = [&](const char* name, const char* type) {
            const std::int64_t accessor = index_or_none(attributes, name);
            return accessor < 0 ? std::nullopt : std::optional(file_.accessor(accessor, type));
        };
        const auto translation = given("TRANSLATION", "VEC3"), rotation = given("ROTATION", "VEC4"),
                   scale = given("SCALE", "VEC3");
        std::optional<std::size_t> count;
        for (const auto* values : {&translation, &rotation, &scale})
            if (*values) {
                if (count && *count != (*values)->size())
                    gltf_fail("attributes of instances have different counts");
                count = (*values)->size();
            }
        constexpr std::array<double, 4> kNoRotation{0, 0, 0, 1};
        std::vector<Affine> places;
        for (std::size_t i = 0; i < count.value_or(1); ++i)
            places.push_back(world * affine_of(translation ? vec3_at(*translation, i) : Vec3{},
                                               rotation ? (*rotation)[i] : kNoRotation.data(),
                                               scale ? vec3_at(*scale, i) : Vec3{1, 1, 1}));
        return places;
    }

    /// Weights of the morph targets: the node's, else the mesh's.
    static std::vector<double> weights_of(const json& node, const json& mesh) {
        const json* weights = member(node, "weights");
        if (weights == nullptr) weights = member(mesh, "weights");
        return weights == nullptr ? std::vector<double>{} : weights->get<std::vector<double>>();
    }

    void read_primitive(const json& primitive, const std::vector<double>& weights, std::int64_t skin,
                        const std::vector<Affine>& places) {
        const std::int64_t mode = member(primitive, "mode") != nullptr ? index_or_none(primitive, "mode") : 4;
        if (mode > 6) gltf_fail(fmt::format("a primitive has the mode {}, expected 0 to 6", mode));
        if (mode < 4) return void(++not_triangles_);
        const std::uint16_t material = material_number(index_or_none(primitive, "material"));
        GltfPrimitive data(file_, primitive);
        Vertices vertices = read_vertices(data, uv_uses_[material]);
        morph(data, weights, vertices);
        if (skin >= 0) bind(data, skin, vertices);
        const std::vector<std::uint32_t> indices = data.indices();
        if (mode == 4 && indices.size() % 3 != 0)
            file_.warn(fmt::format("{} indices of a list of triangles, expected a multiple of 3", indices.size()));
        const auto triangles = triangles_of(data.is_compressed() ? 4 : mode, indices.size());
        for (const Affine& place : places) add(vertices, indices, triangles, place, material);
    }

    std::uint16_t material_number(std::int64_t index) {
        const auto [known, is_new] = numbers_.try_emplace(index, static_cast<std::uint16_t>(materials_.size()));
        if (is_new) {
            if (materials_.size() >= kMaxMaterials) gltf_fail(fmt::format("more than {} materials", kMaxMaterials));
            GltfMaterial material = gltf_material(file_, index);
            materials_.push_back(std::move(material.plain));
            uv_uses_.push_back(material.uv_use);
        }
        return known->second;
    }

    Vertices read_vertices(GltfPrimitive& data, const GltfUvUse& uv_use) {
        Vertices out;
        const GltfValues positions = data.positions();
        const std::size_t n = positions.size();
        for (std::size_t i = 0; i < n; ++i) out.positions.push_back(vec3_at(positions, i));
        if (const auto normals = data.attribute("NORMAL", "VEC3"))
            for (std::size_t i = 0; i < n; ++i) out.normals.push_back(vec3_at(*normals, i));
        if (const auto uvs = data.attribute(fmt::format("TEXCOORD_{}", uv_use.set), "VEC2"))
            for (std::size_t i = 0; i < n; ++i) out.uvs.push_back(uv_use.apply((*uvs)[i][0], (*uvs)[i][1]));
        if (const auto colours = data.attribute("COLOR_0", "VEC3", "VEC4")) read_colours(*colours, out);
        if (data.has("COLOR_1")) file_.warn("second colours of vertices (COLOR_1) are not used");
        return out;
    }

    void read_colours(const GltfValues& colours, Vertices& out) {
        double scale = 1;
        if (!colours.is_float && !colours.is_normalised) {
            const double most = colours.values.empty() ? 0 : *std::ranges::max_element(colours.values);
            scale = 1 / (most > 255 ? 65535.0 : 255.0);
            file_.warn("colours of vertices are integers that are not \"normalized\": read as if they were");
        }
        for (std::size_t i = 0; i < colours.size(); ++i)
            out.colours.push_back(vec_cast<float>(scale * vec3_at(colours, i)));
    }

    void morph(GltfPrimitive& data, const std::vector<double>& weights, Vertices& vertices) {
        const json* targets = member(data.description(), "targets");
        if (targets == nullptr) return;
        for (std::size_t k = 0; k < std::min(weights.size(), targets->size()); ++k) {
            if (weights[k] == 0) continue;
            for (const auto& [name, moved] :
                 {std::pair("POSITION", &vertices.positions), std::pair("NORMAL", &vertices.normals)}) {
                const std::int64_t accessor = index_or_none((*targets)[k], name);
                if (accessor < 0 || moved->empty()) continue;
                const GltfValues change = data.checked(name, file_.accessor(accessor, "VEC3"));
                for (std::size_t i = 0; i < moved->size(); ++i) (*moved)[i] += weights[k] * vec3_at(change, i);
            }
        }
    }

    /// Where a skin's joints carry each vertex.
    void bind(GltfPrimitive& data, std::int64_t skin_index, Vertices& vertices) {
        const json& skin = file_.item("skins", skin_index);
        const std::size_t n = vertices.positions.size();
        std::vector<Affine> joints;
        for (const std::int64_t joint : GltfNodes::indices(skin, "joints")) {
            file_.check_item("nodes", joint);
            joints.push_back(nodes_.world(joint));
        }
        if (const std::int64_t accessor = index_or_none(skin, "inverseBindMatrices"); accessor >= 0) {
            const GltfValues inverse = file_.accessor(accessor, "MAT4");
            if (inverse.size() < joints.size())
                gltf_fail(fmt::format("a skin has {} matrices for {} joints", inverse.size(), joints.size()));
            for (std::size_t i = 0; i < joints.size(); ++i) joints[i] = joints[i] * affine_of_matrix(inverse[i]);
        }
        constexpr Affine kNone{{}, {}, {}, {}};
        vertices.joints.assign(n, kNone);
        for (int set = 0;; ++set) {
            const auto which = data.attribute(fmt::format("JOINTS_{}", set), "VEC4"),
                       weights = data.attribute(fmt::format("WEIGHTS_{}", set), "VEC4");
            if (!which || !weights) {
                if (set == 0) gltf_fail("a mesh with a skin has no JOINTS_0 or WEIGHTS_0");
                break;
            }
            for (std::size_t i = 0; i < 4 * n; ++i) {
                if (weights->values[i] == 0) continue;
                if (!(which->values[i] >= 0 && which->values[i] < static_cast<double>(joints.size())))
                    gltf_fail(fmt::format("a vertex has joint {} of {}", which->values[i], joints.size()));
                vertices.joints[i / 4] += weights->values[i] * joints[static_cast<std::size_t>(which->values[i])];
            }
        }
    }

    void add(const Vertices& v, const std::vector<std::uint32_t>& indices,
             const std::vector<std::array<std::size_t, 3>>& triangles, const Affine& place,
             std::uint16_t material) {
        const auto size = [](const auto& list) { return static_cast<std::uint32_t>(list.size()); };
        const TriangleSoup::Corner first{.position = size(soup_.positions),
                                         .uv = size(soup_.uvs),
                                         .normal = size(soup_.normals),
                                         .colour = size(soup_.colours)};
        const Affine turn = place.normal_map();
        for (std::size_t i = 0; i < v.positions.size(); ++i)
            soup_.positions.push_back((v.joints.empty() ? place : v.joints[i]) * v.positions[i]);
        for (std::size_t i = 0; i < v.normals.size(); ++i)
            soup_.normals.push_back(
                vec_cast<float>((v.joints.empty() ? turn : v.joints[i].normal_map()).turn(v.normals[i])));
        soup_.uvs.insert(soup_.uvs.end(), v.uvs.begin(), v.uvs.end());
        soup_.colours.insert(soup_.colours.end(), v.colours.begin(), v.colours.end());
        const bool is_mirrored = place.determinant() < 0;
        for (const auto& t : triangles) {
            TriangleSoup::Triangle out{.corners = {}, .material = material};
            for (std::size_t k = 0; k < 3; ++k) {
                const std::uint32_t i = indices[t[k]];
                TriangleSoup::Corner& c = out.corners[is_mirrored ? 2 - k : k];
                c.position = first.position + i;
                if (!v.uvs.empty()) c.uv = first.uv + i;
                if (!v.normals.empty()) c.normal = first.normal + i;
                if (!v.colours.empty()) c.colour = first.colour + i;
            }
            soup_.triangles.push_back(out);
        }
    }

    GltfFile& file_;
    GltfNodes nodes_;
    TriangleSoup soup_;
    std::vector<PlainMaterial> materials_;
    std::vector<GltfUvUse> uv_uses_;  ///< of the materials
    std::map<std::int64_t, std::uint16_t> numbers_;
    std::size_t not_triangles_ = 0;
};

}  // namespace

MeshMessage read_gltf(const std::string& path) {
    GltfFile file(path);
    if (file.is_version_1()) return read_with_assimp(path);
    file.check_extensions();
    return MeshWalk(file).read();
}

}  // namespace narpa
