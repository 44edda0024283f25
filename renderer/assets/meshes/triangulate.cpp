#include "renderer/assets/meshes/mesh_readers.h"

#include <cmath>
#include <numeric>

namespace narpa {

namespace {

struct Point {
    double x, y;
    friend bool operator==(const Point&, const Point&) = default;
};

/// Twice the signed area: positive when a, b, c turn to the left.
double turn(const Point& a, const Point& b, const Point& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Newell's normal: twice the polygon's area along its mean plane's normal.
Vec3 newell_normal(std::span<const Vec3> p) {
    Vec3 n;
    for (std::size_t i = 1; i + 1 < p.size(); ++i) n += cross(p[i] - p[0], p[i + 1] - p[0]);
    return n;
}

/// Projects the polygon along the main axis of its normal, so that the corners turn to the left.
std::vector<Point> flattened(std::span<const Vec3> corners) {
    const Vec3 n = newell_normal(corners);
    int drop = 0;
    for (int axis = 1; axis < 3; ++axis)
        if (std::abs(n[axis]) > std::abs(n[drop])) drop = axis;
    const int u = (drop + 1) % 3, v = (drop + 2) % 3;
    std::vector<Point> flat;
    flat.reserve(corners.size());
    for (const Vec3& c : corners) flat.push_back(n[drop] >= 0 ? Point{c[u], c[v]} : Point{c[v], c[u]});
    return flat;
}

bool is_strictly_convex(const std::vector<Point>& p) {
    const std::size_t n = p.size();
    for (std::size_t i = 0; i < n; ++i) {
        if (!(turn(p[i], p[(i + 1) % n], p[(i + 2) % n]) > 0)) return false;
        if (i > 0 && i + 1 < n && !(turn(p[0], p[i], p[i + 1]) > 0)) return false;  // winds more than once
    }
    return true;
}

/// Is the corner `left[i]` an ear: does it turn to the left, with no other corner in its triangle?
bool is_ear(const std::vector<Point>& p, const std::vector<std::uint32_t>& left, std::size_t i) {
    const std::size_t n = left.size();
    const Point &a = p[left[(i + n - 1) % n]], &b = p[left[i]], &c = p[left[(i + 1) % n]];
    if (!(turn(a, b, c) > 0)) return false;
    for (const std::uint32_t k : left) {
        const Point& q = p[k];
        if (q == a || q == b || q == c) continue;
        if (turn(a, b, q) >= 0 && turn(b, c, q) >= 0 && turn(c, a, q) >= 0) return false;
    }
    return true;
}

}  // namespace

std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const Vec3> corners) {
    std::vector<std::array<std::uint32_t, 3>> out;
    if (corners.size() < 3) return out;
    const std::vector<Point> flat = flattened(corners);
    std::vector<std::uint32_t> left(corners.size());
    std::iota(left.begin(), left.end(), 0u);
    const auto cut = [&](std::size_t i) {
        const std::size_t n = left.size();
        out.push_back({left[(i + n - 1) % n], left[i], left[(i + 1) % n]});
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(i));
    };
    bool fan = is_strictly_convex(flat);
    while (left.size() > 3) {
        std::size_t ear = 1;
        while (!fan && ear < left.size() && !is_ear(flat, left, ear)) ++ear;
        if (ear == left.size()) {
            ear = is_ear(flat, left, 0) ? 0 : 1;
            fan = ear == 1;  // no ear: the polygon crosses itself; a search for each triangle would take minutes
        }
        cut(ear);
    }
    cut(1);
    return out;
}

}  // namespace narpa
