// The tree of bounding boxes of a mesh: from one box of the whole mesh down to a few thousand leaves, or two for
// each triangle.
#include <algorithm>
#include <limits>
#include <queue>
#include <span>
#include <unordered_map>

#include "renderer/geometry/mesh_shape.h"

namespace narpa {
namespace {

constexpr std::size_t kBins = 16;
constexpr float kPieceShare = 1.0f / 160;  ///< root of a piece's largest half surface, of the mesh's extent
constexpr int kMaxHalvings = 13;           ///< most recursive halvings of a triangle
constexpr std::size_t kLeavesPerFace = 2, kMinLeaves = 32;  ///< a small mesh has fewer leaves than kBoxLeaves
constexpr std::size_t kPiecesPerLeaf = 16;                  ///< approximate limit for pieces of large triangles
constexpr std::size_t kCells = 256;                         ///< of the grid, along the mesh's largest extent

struct Box {
    static constexpr float kInfinity = std::numeric_limits<float>::infinity();
    std::array<float, 3> low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};

    void add(const Vec3f& p) {
        for (std::size_t k = 0; k < 3; ++k) {
            low[k] = std::min(low[k], p[static_cast<int>(k)]);
            high[k] = std::max(high[k], p[static_cast<int>(k)]);
        }
    }
    void add(const Box& b) {
        for (std::size_t k = 0; k < 3; ++k)
            low[k] = std::min(low[k], b.low[k]), high[k] = std::max(high[k], b.high[k]);
    }
    /// Half of the surface area; 0 for an empty box.
    [[nodiscard]] float surface() const {
        if (!(high[0] >= low[0])) return 0;
        const float x = high[0] - low[0], y = high[1] - low[1], z = high[2] - low[2];
        return x * y + y * z + z * x;
    }
    [[nodiscard]] float middle(std::size_t axis) const { return 0.5f * low[axis] + 0.5f * high[axis]; }
    [[nodiscard]] float extent() const { return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}); }
};

using TriangleCorners = std::array<Vec3f, 3>;

/// Truncates x to a step from 0 to steps - 1; NaN, as from overflow, gives 0.
std::size_t step_at(float x, std::size_t steps) {
    return x > 0 ? static_cast<std::size_t>(std::min(x, static_cast<float>(steps - 1))) : 0;
}

/// Bounding boxes of the triangles. Large triangles are first halved across their longest side, recursively. Boxes
/// whose centres share a cell of a grid, much smaller than the leaves, are merged.
class Pieces {
public:
    Pieces(const Mesh& mesh, std::size_t leaves) {
        box_of_cell_.reserve(mesh.faces.size());
        for (const auto& f : mesh.faces)
            for (const std::uint32_t vertex : f) all_.add(mesh.positions[vertex]);
        float surfaces = 0;
        for (const auto& f : mesh.faces) surfaces += box_of(corners(mesh, f)).surface();
        const float extent = all_.extent();
        largest_ = std::max(kPieceShare * extent * kPieceShare * extent,
                            surfaces / static_cast<float>(kPiecesPerLeaf * leaves));
        cells_per_metre_ = extent > 0 ? kCells / extent : 0;
        for (const auto& f : mesh.faces) cut(corners(mesh, f), kMaxHalvings);
    }
    [[nodiscard]] std::vector<Box>& boxes() { return boxes_; }
    [[nodiscard]] const Box& all() const { return all_; }

private:
    static TriangleCorners corners(const Mesh& mesh, const std::array<std::uint32_t, 3>& f) {
        return {mesh.positions[f[0]], mesh.positions[f[1]], mesh.positions[f[2]]};
    }
    static Box box_of(const TriangleCorners& t) {
        Box box;
        for (const Vec3f& p : t) box.add(p);
        return box;
    }

    void cut(const TriangleCorners& t, int halvings) {
        const Box box = box_of(t);
        if (!(box.surface() > largest_) || halvings == 0) return add(box);
        std::size_t longest = 0;
        float longest2 = -1;
        for (std::size_t i = 0; i < 3; ++i) {
            const Vec3f side = t[(i + 1) % 3] - t[i];
            if (const float length2 = dot(side, side); length2 > longest2) longest = i, longest2 = length2;
        }
        const Vec3f &a = t[longest], &b = t[(longest + 1) % 3], &c = t[(longest + 2) % 3];
        const Vec3f middle = 0.5f * a + 0.5f * b;
        cut({a, middle, c}, halvings - 1);
        cut({middle, b, c}, halvings - 1);
    }

    void add(const Box& box) {
        std::size_t cell = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            cell = cell * kCells + step_at((box.middle(k) - all_.low[k]) * cells_per_metre_, kCells);
        }
        const auto [known, is_new] = box_of_cell_.try_emplace(cell, boxes_.size());
        if (is_new) boxes_.emplace_back();
        boxes_[known->second].add(box);
    }

    std::unordered_map<std::size_t, std::size_t> box_of_cell_;
    std::vector<Box> boxes_;
    Box all_;
    float largest_ = 0, cells_per_metre_ = 0;
};

struct Part {
    std::uint32_t node;
    std::span<Box> pieces;
    float surface;
    friend bool operator<(const Part& a, const Part& b) {
        return a.surface != b.surface ? a.surface < b.surface : a.node > b.node;
    }
};

/// Splits at the plane of least cost by the surface area heuristic, of kBins - 1 planes on each axis, after I.
/// Wald, "On fast construction of SAH-based bounding volume hierarchies" (2007). Moves the pieces on its lower side
/// to the front and returns their number; 0 if no plane separates the pieces.
std::size_t part(std::span<Box> pieces) {
    Box middles;
    for (const Box& p : pieces) middles.add(Vec3f{p.middle(0), p.middle(1), p.middle(2)});
    std::array<float, 3> per_metre{};
    for (std::size_t k = 0; k < 3; ++k) {
        const float extent = middles.high[k] - middles.low[k];
        per_metre[k] = extent > 0 ? kBins / extent : 0;
    }
    const auto bin_of = [&](const Box& p, std::size_t axis) {
        return step_at((p.middle(axis) - middles.low[axis]) * per_metre[axis], kBins);
    };
    std::array<std::array<Box, kBins>, 3> bins;
    std::array<std::array<std::size_t, kBins>, 3> count{};
    for (const Box& p : pieces)
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::size_t bin = bin_of(p, axis);
            bins[axis][bin].add(p), ++count[axis][bin];
        }
    float cheapest = std::numeric_limits<float>::infinity();
    std::size_t best_axis = 0, best_bin = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        std::array<float, kBins> above{};
        Box box;
        for (std::size_t bin = kBins; bin-- > 1;) box.add(bins[axis][bin]), above[bin] = box.surface();
        box = {};
        std::size_t below = 0;
        for (std::size_t bin = 1; bin < kBins; ++bin) {
            box.add(bins[axis][bin - 1]), below += count[axis][bin - 1];
            if (below == 0 || below == pieces.size()) continue;
            if (const float cost = box.surface() + above[bin]; cost < cheapest)
                cheapest = cost, best_axis = axis, best_bin = bin;
        }
    }
    if (best_bin == 0) return 0;
    const auto lower_end =
        std::partition(pieces.begin(), pieces.end(), [&](const Box& p) { return bin_of(p, best_axis) < best_bin; });
    return static_cast<std::size_t>(lower_end - pieces.begin());
}

BoxNode node_about(std::span<const Box> pieces) {
    Box box;
    for (const Box& p : pieces) box.add(p);
    return {box.low, box.high};
}

}  // namespace

std::vector<BoxNode> box_tree(const Mesh& mesh) {
    if (mesh.faces.empty()) return {};
    const std::size_t most = std::clamp(kLeavesPerFace * mesh.faces.size(), kMinLeaves, kBoxLeaves);
    Pieces pieces(mesh, most);
    std::vector<BoxNode> nodes{{pieces.all().low, pieces.all().high}};
    std::priority_queue<Part> to_cut;
    to_cut.push({0, pieces.boxes(), pieces.all().surface()});
    for (std::size_t leaves = 1; leaves < most && !to_cut.empty();) {
        const Part p = to_cut.top();
        to_cut.pop();
        const std::size_t lower = part(p.pieces);
        if (lower == 0) continue;
        ++leaves;
        nodes[p.node].children = static_cast<std::uint32_t>(nodes.size());
        for (const std::span<Box> half : {p.pieces.first(lower), p.pieces.subspan(lower)}) {
            const BoxNode& node = nodes.emplace_back(node_about(half));
            to_cut.push({static_cast<std::uint32_t>(nodes.size() - 1), half, Box{node.low, node.high}.surface()});
        }
    }
    return nodes;
}

}  // namespace narpa
