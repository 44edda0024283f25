/// renderer/geometry/triangle.h - ray-triangle intersection in double, in the frame of the body.
///
/// Branch-free, so that the compiler vectorises loops over the rays of a packet.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/lanes.h"

namespace narpa {

struct Triangle {
    Vec3 a, b, c;

    /// Normal by the winding; its length is twice the area.
    [[nodiscard]] Vec3 normal() const noexcept { return cross(b - a, c - a); }
};

/// A triangle for each ray.
struct TriangleLanes {
    Vec3Lanes a, b, c;

    [[nodiscard]] Triangle operator[](std::size_t i) const { return {a[i], b[i], c[i]}; }
    void put(std::size_t i, const Triangle& t) { a.put(i, t.a), b.put(i, t.b), c.put(i, t.c); }
};

struct TrianglePoint {
    Vec3 position{};
    double b1 = 0, b2 = 0;  ///< barycentric weights of b and c
};

/// The hit of a ray that is known to hit the triangle (T. Moller, B. Trumbore, "Fast, minimum storage ray-triangle
/// intersection", Journal of Graphics Tools 2(1), 1997), clamped to the triangle so that a hit on an edge stays on
/// the surface. Where the equations are singular, as for a sliver seen end on, the weights are u and v.
[[nodiscard]] inline TrianglePoint hit_point(const Triangle& t, const Vec3& start, const Vec3& direction, double u,
                                             double v) noexcept {
    const Vec3 e1 = t.b - t.a, e2 = t.c - t.a;
    const Vec3 p = cross(direction, e2), s = start - t.a, q = cross(s, e1);
    const double inverse_det = 1 / dot(e1, p);
    double b1 = dot(s, p) * inverse_det, b2 = dot(direction, q) * inverse_det;
    const bool solved = (b1 - b1) + (b2 - b2) == 0;  // both are finite
    b1 = std::min(std::max(0.0, choose(solved, b1, u)), 1.0);
    b2 = std::min(std::max(0.0, choose(solved, b2, v)), 1.0);
    const double part = std::max(1.0, b1 + b2);
    b1 /= part, b2 /= part;
    return {t.a + b1 * e1 + b2 * e2, b1, b2};
}

/// The surface about a point of a triangle.
struct TriangleSurface {
    Vec3 outwards{};        ///< unit, by the winding
    Vec3 smooth{};          ///< unit, interpolated from the vertex normals, on the same side
    Vec3 above{}, below{};  ///< where rays leave on the outer and on the inner side
};

/// The surface of a mesh without vertex normals. `otherwise`: the normal of a triangle without area.
[[nodiscard]] inline TriangleSurface flat_surface(const Triangle& t, const Vec3& position,
                                                  const Vec3& otherwise) noexcept {
    const Vec3 normal = t.normal();
    const double area2 = norm(normal);
    const Vec3 outwards = choose(area2 > 0, normal / area2, otherwise);
    return {outwards, outwards, position, position};
}

/// `normals` are those of the vertices; zero: the surface is flat.
///
/// Rays leave from the surface that the normals describe, which is above the flat triangle where the mesh bulges to
/// their side: J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II (2021), chapter 4.
[[nodiscard]] inline TriangleSurface surface_about(const Triangle& t, const TrianglePoint& p,
                                                   const std::array<Vec3, 3>& normals,
                                                   const Vec3& otherwise) noexcept {
    TriangleSurface s = flat_surface(t, p.position, otherwise);
    const double weight_a = 1 - p.b1 - p.b2;
    const double height_a = dot(p.position - t.a, normals[0]), height_b = dot(p.position - t.b, normals[1]),
                 height_c = dot(p.position - t.c, normals[2]);
    const Vec3 way_a = (-weight_a * height_a) * normals[0], way_b = (-p.b1 * height_b) * normals[1],
               way_c = (-p.b2 * height_c) * normals[2];
    const Vec3 bulge = choose(height_a < 0, way_a, {}) + choose(height_b < 0, way_b, {}) +
                       choose(height_c < 0, way_c, {}),
               hollow = choose(height_a < 0, {}, way_a) + choose(height_b < 0, {}, way_b) +
                        choose(height_c < 0, {}, way_c);
    const Vec3 mean = weight_a * normals[0] + p.b1 * normals[1] + p.b2 * normals[2];
    const Vec3 smooth = choose(dot(mean, s.outwards) < 0, -mean, mean);
    const double length = norm(smooth);
    s.smooth = choose(length > 0, smooth / length, s.outwards);
    s.above = choose(dot(bulge, s.outwards) > 0, p.position + bulge, p.position);
    s.below = choose(dot(hollow, s.outwards) < 0, p.position + hollow, p.position);
    return s;
}

/// Offset of a ray that leaves a triangle, and whether its start is far enough from the edges.
struct Departure {
    Vec3 normal{};           ///< unit; zero where the triangle has no area
    double lift_m = 0;       ///< along the normal: the bound of the rounding error in single precision
    double clearance_m = 0;  ///< distance from the edges at which the lift does not cross a neighbouring face that
                             ///< meets at 7 degrees or more
    bool near_edge = false;  ///< possibly nearer than that, or without an area
};

/// Departure from `position`. `from_origin`: the same point relative to Embree's origin.
[[nodiscard]] inline Departure departure_from(const Triangle& t, const Vec3& position,
                                              const Vec3& from_origin) noexcept {
    constexpr double kHalfUlp = 0x1p-24;  // largest relative rounding error of single precision
    const auto largest = [](const Vec3& v) {
        return std::max(std::max(std::abs(v.x), std::abs(v.y)), std::abs(v.z));
    };
    const Vec3 to_a = t.a - position, to_b = t.b - position, to_c = t.c - position;
    // Twice the areas of the three triangles that the position makes with the edges; their sum is the face's.
    const Vec3 ab = cross(to_a, to_b), bc = cross(to_b, to_c), ca = cross(to_c, to_a), outwards = ab + bc + ca;
    const double area2 = norm(outwards);
    Departure d{.normal = choose(area2 > 0, outwards / area2, {})};

    // The start is rounded to single precision (an error of the position's size); Embree's test then rounds the
    // corners relative to it and their cross products (errors of the triangle's size). First-order bounds after
    // Pharr, Jakob, Humphreys, Physically Based Rendering, section 3.9.
    const double extent = std::max(std::max(largest(to_a), largest(to_b)), largest(to_c));
    d.lift_m = kHalfUlp * (4 * largest(from_origin) + 16 * extent);
    d.clearance_m = 8 * d.lift_m;
    const double longest_m = 2 * std::sqrt(3.0) * extent;
    const double nearest =
        std::min(std::min(dot(d.normal, ab), dot(d.normal, bc)), dot(d.normal, ca));  // times an edge's length
    d.near_edge = !(nearest > d.clearance_m * longest_m);
    return d;
}

/// Moves a point of the triangle towards the incentre until it is `clearance_m` away from each edge, by at most
/// eight times that.
[[nodiscard]] inline Vec3 away_from_edges(const Triangle& t, const Vec3& p, const Departure& d) noexcept {
    if (d.normal == Vec3{}) return p;
    const std::array<Vec3, 3> corner{t.a, t.b, t.c}, edge{t.b - t.a, t.c - t.b, t.a - t.c};
    const std::array<double, 3> length{norm(edge[0]), norm(edge[1]), norm(edge[2])};
    std::array<double, 3> height;
    for (std::size_t k = 0; k < 3; ++k) height[k] = dot(cross(d.normal, edge[k]), p - corner[k]) / length[k];
    if (std::min({height[0], height[1], height[2]}) >= d.clearance_m) return p;

    const double perimeter = length[0] + length[1] + length[2];
    const Vec3 middle = (length[1] * t.a + length[2] * t.b + length[0] * t.c) / perimeter;
    const double radius = dot(cross(d.normal, edge[0]), middle - t.a) / length[0];
    double part = 0;
    for (const double h : height)
        if (h < d.clearance_m) part = std::max(part, (d.clearance_m - h) / std::max(radius - h, d.clearance_m));
    const Vec3 way = middle - p;
    return p + std::min(part, 8 * d.clearance_m / norm(way)) * way;
}

}  // namespace narpa
