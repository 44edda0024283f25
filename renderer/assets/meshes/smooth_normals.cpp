#include "renderer/assets/meshes/smooth_normals.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace narpa {
namespace {

/// Shorter sums of normals, from faces back to back, have no usable direction.
constexpr double kCancelled = 1e-6;

struct FlatCorner {
    Vec3 normal{};     ///< of the triangle, unit length
    double angle = 0;  ///< 0: without area, or not finite
};

/// Three for each triangle.
std::vector<FlatCorner> flat_corners(const TriangleSoup& soup) {
    std::vector<FlatCorner> out;
    out.reserve(3 * soup.triangles.size());
    for (const auto& corners : soup.triangles.position) {
        std::array<Vec3, 3> p;
        for (std::size_t i = 0; i < 3; ++i) p[i] = soup.positions[corners[i]];
        const Vec3 area = cross(p[1] - p[0], p[2] - p[0]);
        const double twice = norm(area);
        for (std::size_t i = 0; i < 3; ++i) {
            const double along = dot(p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i]);
            const bool usable = twice > 0 && std::isfinite(twice) && std::isfinite(along);
            out.push_back(usable ? FlatCorner{area / twice, std::atan2(twice, along)} : FlatCorner{});
        }
    }
    return out;
}

/// The usable corners, sorted by position.
std::vector<std::size_t> by_position(const TriangleSoup& soup, const std::vector<FlatCorner>& flat) {
    std::vector<std::size_t> corners;
    for (std::size_t k = 0; k < flat.size(); ++k)
        if (flat[k].angle > 0) corners.push_back(k);
    const auto key = [&](std::size_t k) {
        const Vec3& p = soup.positions[soup.triangles.position[k / 3][k % 3]];
        return std::array{p.x, p.y, p.z};
    };
    std::ranges::stable_sort(corners, {}, key);
    return corners;
}

}  // namespace

void add_smooth_normals(TriangleSoup& soup, double crease_rad) {
    const std::vector<FlatCorner> flat = flat_corners(soup);
    const std::vector<std::size_t> corners = by_position(soup, flat);
    TriangleSoup::Triangles& triangles = soup.triangles;
    const auto position = [&](std::size_t k) -> const Vec3& {
        return soup.positions[triangles.position[k / 3][k % 3]];
    };
    const double min_cosine = std::cos(crease_rad);
    for (auto first = corners.begin(); first != corners.end();) {
        const auto end = std::find_if(first, corners.end(), [&](std::size_t k) {
            const Vec3 &a = position(k), &b = position(*first);
            return a.x != b.x || a.y != b.y || a.z != b.z;
        });
        const auto count = static_cast<std::size_t>(end - first);
        for (auto k = first; k != end && count <= kMaxSmoothed; ++k) {
            Vec3 sum{};
            for (auto other = first; other != end; ++other)
                if (*other == *k || dot(flat[*k].normal, flat[*other].normal) > min_cosine)
                    sum = sum + flat[*other].angle * flat[*other].normal;
            if (!(norm(sum) > kCancelled)) continue;
            triangles.set(triangles.normal, *k / 3, *k % 3, static_cast<std::uint32_t>(soup.normals.size()));
            soup.normals.push_back(vec_cast<float>(sum));
        }
        first = end;
    }
}

}  // namespace narpa
