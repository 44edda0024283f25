#include "renderer/trace/mesh_topology.h"

#include <tbb/parallel_sort.h>

#include <bit>
#include <numeric>

namespace narpa {
namespace {

/// The same number for vertices at the same place: readers split a vertex where its normal or texture jumps.
std::vector<std::uint32_t> welded(const std::vector<Vec3f>& positions) {
    const auto key = [&](std::uint32_t i) {
        const Vec3f& p = positions[i];
        return std::array{std::bit_cast<std::uint32_t>(p.x + 0.0f), std::bit_cast<std::uint32_t>(p.y + 0.0f),
                          std::bit_cast<std::uint32_t>(p.z + 0.0f)};  // + 0: -0 and 0 are one place
    };
    std::vector<std::uint32_t> order(positions.size()), id(positions.size());
    std::iota(order.begin(), order.end(), 0u);
    tbb::parallel_sort(order.begin(), order.end(),
                       [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
    for (std::size_t i = 0; i < order.size(); ++i)
        id[order[i]] = i > 0 && key(order[i]) == key(order[i - 1]) ? id[order[i - 1]] : order[i];
    return id;
}

}  // namespace

bool is_closed(const Mesh& mesh) {
    const std::vector<std::uint32_t> id = welded(mesh.positions);
    struct Edge {
        std::uint64_t ends;  ///< the smaller vertex above, the larger below
        int direction;
    };
    std::vector<Edge> edges;
    edges.reserve(3 * mesh.faces.size());
    for (const auto& f : mesh.faces)
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint64_t a = id[f[k]], b = id[f[(k + 1) % 3]];
            edges.push_back(a < b ? Edge{a << 32 | b, 1} : Edge{b << 32 | a, -1});
        }
    tbb::parallel_sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) { return a.ends < b.ends; });
    for (std::size_t i = 0; i < edges.size();) {
        int sum = 0;
        const std::uint64_t ends = edges[i].ends;
        for (; i < edges.size() && edges[i].ends == ends; ++i) sum += edges[i].direction;
        if (sum != 0) return false;
    }
    return !edges.empty();
}

}  // namespace narpa
