#include "renderer/mesh_reader/gltf_nodes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/pose.h"

namespace narpa {

namespace {

using nlohmann::json;

Affine local_of(const json& node) {
    if (member(node, "matrix") != nullptr) {
        std::array<double, 16> m{};
        numbers_into(node, "matrix", m);
        return affine_of_matrix(m.data());
    }
    std::array<double, 3> translation{}, scale{1, 1, 1};
    std::array<double, 4> rotation{0, 0, 0, 1};
    numbers_into(node, "translation", translation);
    numbers_into(node, "rotation", rotation);
    numbers_into(node, "scale", scale);
    return affine_of({translation[0], translation[1], translation[2]}, rotation.data(),
                     {scale[0], scale[1], scale[2]});
}

}  // namespace

Affine affine_of(const Vec3& translation, const double* xyzw, const Vec3& scale) {
    Quat q{xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
    const double length = norm(q);
    if (!(length > 0)) gltf_fail("a rotation is the quaternion 0, expected one of length 1");
    q = normalized(q);
    return {scale.x * (q * Vec3{1, 0, 0}), scale.y * (q * Vec3{0, 1, 0}), scale.z * (q * Vec3{0, 0, 1}),
            translation};
}

Affine affine_of_matrix(const double* m) {
    return {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
}

std::vector<std::int64_t> GltfNodes::indices(const json& object, const char* name) {
    std::vector<std::int64_t> out;
    const json* list = member(object, name);
    if (list == nullptr || !list->is_array()) return out;
    for (const json& index : *list) {
        if (!index.is_number_unsigned()) gltf_fail(fmt::format("\"{}\": expected indices", name));
        out.push_back(index.get<std::int64_t>());
    }
    return out;
}

GltfNodes::GltfNodes(GltfFile& file) {
    const json* nodes = member(file.root(), "nodes");
    const std::size_t n = nodes != nullptr && nodes->is_array() ? nodes->size() : 0;
    std::vector<std::vector<std::int64_t>> children(n);
    std::vector<bool> has_parent(n, false);
    for (std::size_t i = 0; i < n; ++i)
        for (const std::int64_t child : children[i] = indices((*nodes)[i], "children")) {
            if (child < 0 || static_cast<std::size_t>(child) >= n || has_parent[static_cast<std::size_t>(child)])
                gltf_fail(
                    fmt::format("node {} is a child of node {}, expected a node with no other parent", child, i));
            has_parent[static_cast<std::size_t>(child)] = true;
        }
    world_.resize(n);
    std::vector<std::int64_t> roots;
    for (std::size_t i = 0; i < n; ++i)
        if (!has_parent[i]) roots.push_back(static_cast<std::int64_t>(i));
    for (const std::int64_t root : roots) place(file, root, children);
    show_scene(file, children, roots);
}

void GltfNodes::place(GltfFile& file, std::int64_t root, const std::vector<std::vector<std::int64_t>>& children) {
    world_[static_cast<std::size_t>(root)] = local_of(file.item("nodes", root));
    std::vector<std::int64_t> pending{root};
    while (!pending.empty()) {
        const auto node = static_cast<std::size_t>(pending.back());
        pending.pop_back();
        for (const std::int64_t child : children[node]) {
            world_[static_cast<std::size_t>(child)] = world_[node] * local_of(file.item("nodes", child));
            pending.push_back(child);
        }
    }
}

void GltfNodes::show_scene(GltfFile& file, const std::vector<std::vector<std::int64_t>>& children,
                           const std::vector<std::int64_t>& roots) {
    std::vector<std::int64_t> pending = roots;
    if (const json* scenes = member(file.root(), "scenes"); scenes != nullptr && !scenes->empty()) {
        const std::int64_t chosen = std::max<std::int64_t>(0, index_or_none(file.root(), "scene"));
        pending = indices(file.item("scenes", chosen), "nodes");
        if (scenes->size() > 1)
            file.warn(
                fmt::format("of its {} scenes only scene {} is used, counted from 0", scenes->size(), chosen));
    }
    std::vector<bool> seen(children.size(), false);
    std::reverse(pending.begin(), pending.end());
    while (!pending.empty()) {
        const std::int64_t node = pending.back();
        pending.pop_back();
        file.check_item("nodes", node);
        if (seen[static_cast<std::size_t>(node)])
            gltf_fail(fmt::format("node {} is in the scene twice, expected a tree", node));
        seen[static_cast<std::size_t>(node)] = true;
        shown_.push_back(node);
        const auto& below = children[static_cast<std::size_t>(node)];
        pending.insert(pending.end(), below.rbegin(), below.rend());
    }
}

}  // namespace narpa
