// Tests whether a mesh is a closed surface.
#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "renderer/geometry/mesh_shape.h"

namespace narpa {
namespace {

/// A number for each vertex, the same for vertices at the same position: readers split a vertex where its normal or
/// texture coordinates are discontinuous.
std::vector<std::uint32_t> welded(const std::vector<Vec3f>& positions) {
    constexpr std::uint32_t kFree = 0xffff'ffffu;
    const auto key = [&](std::size_t i) {
        const Vec3f& p = positions[i];
        return std::array{std::bit_cast<std::uint32_t>(p.x + 0.0f), std::bit_cast<std::uint32_t>(p.y + 0.0f),
                          std::bit_cast<std::uint32_t>(p.z + 0.0f)};  // + 0: -0 and 0 are one place
    };
    std::vector<std::uint32_t> slots(std::bit_ceil(2 * positions.size() + 16), kFree), id(positions.size());
    for (std::size_t i = 0; i < positions.size(); ++i) {
        const auto k = key(i);
        std::uint64_t hash = 0x9e37'79b9'7f4a'7c15ull;
        for (const std::uint32_t word : k) hash = (hash ^ word) * 0xff51'afd7'ed55'8ccdull, hash ^= hash >> 32;
        std::size_t slot = hash & (slots.size() - 1);
        while (slots[slot] != kFree && key(slots[slot]) != k) slot = (slot + 1) & (slots.size() - 1);
        if (slots[slot] == kFree) slots[slot] = static_cast<std::uint32_t>(i);
        id[i] = slots[slot];
    }
    return id;
}

}  // namespace

bool is_closed(const Mesh& mesh) {
    const std::vector<std::uint32_t> id = welded(mesh.positions);
    const auto for_each_edge = [&](const auto& f) {
        for (const auto& face : mesh.faces)
            for (std::size_t k = 0; k < 3; ++k) {
                const std::uint32_t a = id[face[k]], b = id[face[(k + 1) % 3]];
                a < b ? f(a, b, 0u) : f(b, a, 1u);
            }
    };
    // Edges grouped by their smaller vertex: each entry is the larger vertex, with the direction in the last bit.
    std::vector<std::uint32_t> first(mesh.positions.size() + 2, 0);
    for_each_edge([&](std::uint32_t smaller, std::uint32_t, std::uint32_t) { ++first[smaller + 2]; });
    for (std::size_t v = 2; v < first.size(); ++v) first[v] += first[v - 1];
    std::vector<std::uint64_t> ends(3 * mesh.faces.size());
    for_each_edge([&](std::uint32_t smaller, std::uint32_t larger, std::uint32_t direction) {
        ends[first[smaller + 1]++] = std::uint64_t{larger} << 1 | direction;
    });
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const auto begin = ends.begin() + first[v], end = ends.begin() + first[v + 1];
        std::sort(begin, end);
        for (auto e = begin; e != end;) {
            int sum = 0;
            const std::uint64_t larger = *e >> 1;
            for (; e != end && *e >> 1 == larger; ++e) sum += (*e & 1) != 0 ? -1 : 1;
            if (sum != 0) return false;
        }
    }
    return !ends.empty();
}

}  // namespace narpa
