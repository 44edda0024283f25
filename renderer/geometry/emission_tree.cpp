#include "renderer/geometry/emission_tree.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "base/constants.h"

namespace narpa {
namespace {

/// Faces that fill this part of a disc of their sphere's radius are not told apart, if they are few and nearly
/// parallel: their importances would hardly differ.
constexpr double kCompact = 0.3, kNearlyParallel = 0.9;
constexpr std::uint32_t kMaxInLeaf = 8;

struct FaceBox {
    Vec3 low{kInfinity, kInfinity, kInfinity}, high{-kInfinity, -kInfinity, -kInfinity};

    void add(const Vec3& p) {
        for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
    }
    void add(const EmissiveFace& f) {
        for (const Vec3& p : f.corner_m) add(p);
    }
    [[nodiscard]] Vec3 centre() const { return 0.5 * (low + high); }
    [[nodiscard]] double squared_size() const { return dot(high - low, high - low); }
};

Vec3 doubled_area(const EmissiveFace& f) {
    return cross(f.corner_m[1] - f.corner_m[0], f.corner_m[2] - f.corner_m[0]);
}
Vec3 centroid(const EmissiveFace& f) {
    return (f.corner_m[0] + f.corner_m[1] + f.corner_m[2]) / 3.0;
}

}  // namespace

EmissionTree::EmissionTree(std::vector<EmissiveFace> faces) : faces_(std::move(faces)) {
    if (faces_.empty()) return;
    nodes_.push_back(cluster(0, static_cast<std::uint32_t>(faces_.size())));
    for (std::uint32_t i = 0; i < nodes_.size(); ++i) {
        if (is_compact(nodes_[i])) continue;
        const std::uint32_t first = nodes_[i].first, end = nodes_[i].end, middle = split(nodes_[i]);
        nodes_[i].children = static_cast<std::uint32_t>(nodes_.size());
        for (const auto& [a, b] : {std::array{first, middle}, std::array{middle, end}}) {
            nodes_.push_back(cluster(a, b));
            nodes_.back().parent = i;
        }
    }
    std::uint32_t last = 0;
    for (const EmissiveFace& f : faces_) last = std::max(last, f.face);
    leaf_of_face_.assign(last + 1, kNoLeaf);
    for (std::uint32_t i = 0; i < nodes_.size(); ++i)
        if (nodes_[i].children == 0)
            for (std::uint32_t k = nodes_[i].first; k < nodes_[i].end; ++k) leaf_of_face_[faces_[k].face] = i;
}

EmissionTree::Node EmissionTree::cluster(std::uint32_t first, std::uint32_t end) const {
    Node n;
    n.first = first, n.end = end;
    FaceBox box;
    Vec3 axis{};
    for (std::uint32_t k = first; k < end; ++k) {
        box.add(faces_[k]);
        const Vec3 normal = doubled_area(faces_[k]);
        axis += dot(normal, axis) < 0 ? -normal : normal;
        n.power += faces_[k].power;
    }
    n.centre_m = box.centre();
    n.axis = normalized(axis);
    for (std::uint32_t k = first; k < end; ++k) {
        for (const Vec3& p : faces_[k].corner_m) n.radius_m = std::max(n.radius_m, norm(p - n.centre_m));
        n.cos_spread = std::min(n.cos_spread, std::abs(dot(normalized(doubled_area(faces_[k])), n.axis)));
    }
    n.sin_spread = std::sqrt(std::max(0.0, 1 - n.cos_spread * n.cos_spread));
    return n;
}

bool EmissionTree::is_compact(const Node& n) const {
    if (n.end - n.first == 1) return true;
    if (n.end - n.first > kMaxInLeaf || n.cos_spread < kNearlyParallel) return false;
    double area = 0;
    for (std::uint32_t k = n.first; k < n.end; ++k) area += 0.5 * norm(doubled_area(faces_[k]));
    return area >= kCompact * kPi * n.radius_m * n.radius_m;
}

/// Sorts a cluster's faces along the longest side of the box of their centroids, and returns where to cut: where
/// the sum of the two parts' powers times squared sizes is least, but at the middle of clusters of many faces, so
/// that the tree has logarithmic depth.
std::uint32_t EmissionTree::split(const Node& n) {
    constexpr std::uint32_t kMany = 256;
    const auto begin = faces_.begin() + n.first, end = faces_.begin() + n.end;
    FaceBox centroids;
    std::for_each(begin, end, [&](const EmissiveFace& f) { centroids.add(centroid(f)); });
    const Vec3 size = centroids.high - centroids.low;
    const int along = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::stable_sort(begin, end, [&](const EmissiveFace& a, const EmissiveFace& b) {
        return centroid(a)[along] < centroid(b)[along];
    });
    const std::uint32_t count = n.end - n.first;
    if (count > kMany) return n.first + count / 2;
    std::vector<double> after(count);
    FaceBox box;
    double power = 0;
    for (std::uint32_t k = count; k-- > 1;) {
        box.add(begin[k]), power += begin[k].power;
        after[k] = power * box.squared_size();
    }
    box = {}, power = 0;
    std::uint32_t cut = 1;
    double least = kInfinity;
    for (std::uint32_t k = 1; k < count; ++k) {
        box.add(begin[k - 1]), power += begin[k - 1].power;
        if (const double cost = power * box.squared_size() + after[k]; cost < least) least = cost, cut = k;
    }
    return n.first + cut;
}

double EmissionTree::importance(const Node& n, const Seen& from) noexcept {
    const Vec3 centre = from.to_origin_m + n.centre_m;
    const double distance2 = dot(centre, centre), radius2 = n.radius_m * n.radius_m;
    if (distance2 <= radius2) return n.power / radius2;
    const double distance = std::sqrt(distance2), highest = dot(centre, from.up) + n.radius_m;
    if (highest <= 0) return 0;
    // The least angle between a normal and the way from a point of the sphere: that of the axis, less the normals'
    // spread, less the sphere's angular radius.
    const double sin_sphere = n.radius_m / distance, cos_sphere = std::sqrt(1 - sin_sphere * sin_sphere);
    const double cos_axis = std::min(1.0, std::abs(dot(n.axis, centre)) / distance);
    double cosine = 1;
    if (cos_axis < n.cos_spread) {
        const double sin_axis = std::sqrt(1 - cos_axis * cos_axis);
        const double cos_normal = cos_axis * n.cos_spread + sin_axis * n.sin_spread;
        const double sin_normal = sin_axis * n.cos_spread - cos_axis * n.sin_spread;
        if (cos_normal < cos_sphere) cosine = cos_normal * cos_sphere + sin_normal * sin_sphere;
    }
    return n.power / distance2 * std::min(1.0, highest / distance) * std::max(cosine, 0.0);
}

double EmissionTree::first_probability(const Node& n, const Seen& from) const noexcept {
    const double first = importance(nodes_[n.children], from), second = importance(nodes_[n.children + 1], from);
    return first + second > 0 ? first / (first + second) : -1;
}

std::optional<std::size_t> EmissionTree::choose(const Seen& from, double choice) const noexcept {
    const Node* n = nodes_.data();
    while (n->children != 0) {
        const double first = first_probability(*n, from);
        if (first < 0) return std::nullopt;
        const bool is_first = choice < first;
        choice = is_first ? choice / first : (choice - first) / (1 - first);
        n = &nodes_[n->children + (is_first ? 0 : 1)];
    }
    double left = choice * n->power;
    std::uint32_t k = n->first;
    while (k + 1 < n->end && left >= faces_[k].power) left -= faces_[k++].power;
    return k;
}

double EmissionTree::probability_per_power(const Seen& from, std::uint32_t face) const noexcept {
    if (face >= leaf_of_face_.size() || leaf_of_face_[face] == kNoLeaf) return 0;
    std::uint32_t node = leaf_of_face_[face];
    double probability = 1 / nodes_[node].power;
    while (node != 0) {
        const Node& above = nodes_[nodes_[node].parent];
        const double first = first_probability(above, from);
        if (first < 0) return 0;
        probability *= node == above.children ? first : 1 - first;
        node = nodes_[node].parent;
    }
    return probability;
}

}  // namespace narpa
