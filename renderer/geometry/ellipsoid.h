/// renderer/geometry/ellipsoid.h - a sphere or ellipsoid about its body's origin, solved in double.
///
/// Intersections are solved in a frame scaled along the axes so that the ellipsoid is a sphere of its largest
/// semi-axis; the direction is not unit there. For a sphere the scale is exactly 1, so that scaling causes no
/// rounding.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "base/constants.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/geometry/sphere_roots.h"

namespace narpa {

/// Where a ray hits the surface.
struct Crossing {
    double range = std::numeric_limits<double>::infinity();  ///< multiples of the direction; infinity: nowhere
    bool outside = true;                                     ///< from the outer side
};

class EllipsoidShape final : public Shape {
public:
    /// `material` is an index into Scene::materials; one with `maps` gets texture coordinates.
    explicit EllipsoidShape(const Vec3& semi_axes_m, int material = 0, std::optional<MapLatitude> maps = {});

    std::uint32_t intersect(const ShapeRays& rays, std::uint32_t wanted, ShapeHits& hits) const noexcept override;
    [[nodiscard]] std::uint32_t occluded(const ShapeRays& rays, std::uint32_t wanted) const noexcept override;
    void surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept override;
    [[nodiscard]] TextureFrame texture_frame(const Hit& hit) const noexcept override;
    [[nodiscard]] std::unique_ptr<const EmissiveSurface> emission(const Scene& scene) const override;

    /// The nearest crossing that is not behind the ray's origin. Branch-free, as all that follows, for loops over
    /// lanes.
    [[nodiscard]] Crossing first_crossing(const Vec3& o, const Vec3& d) const noexcept {
        const SphereRoots roots = sphere_roots(o * scale_to_sphere_, d * scale_to_sphere_, radius_m_);
        const bool outside = roots.near >= 0;
        const double ahead = roots.far >= 0 ? roots.far : kInfinity;
        return {outside ? roots.near : ahead, outside};
    }

    /// The same for a ray that leaves the surface at `start`. The shape is convex: a ray that leaves its outer side
    /// hits it only if it points inwards, at range 0; one that leaves its inner side hits the other end of the
    /// chord, at range 0 if it points outwards.
    [[nodiscard]] Crossing own_crossing(const Vec3& start, const Vec3& d, bool outside) const noexcept {
        const Vec3 o = start * scale_to_sphere_, e = d * scale_to_sphere_;
        const double up = dot(o, e), chord = std::max(0.0, -2 * up / dot(e, e));
        const double inwards = up < 0 ? 0 : kInfinity;
        return {outside ? inwards : chord, outside};
    }

    /// Outward unit normal at p.
    [[nodiscard]] Vec3 normal(const Vec3& p) const noexcept {
        return normalized(p * scale_to_sphere_ * scale_to_sphere_);
    }

    /// Projects p onto the surface along the line through the centre.
    [[nodiscard]] Vec3 onto_surface(const Vec3& p) const noexcept {
        const Vec3 q = p * scale_to_sphere_;
        return (1 / norm(q)) * q * semi_axes_m_;
    }

    /// The direction whose longitude and latitude are those of a point p on a map, unit.
    [[nodiscard]] Vec3 map_direction(const Vec3& p) const noexcept {
        if (map_latitude_ == MapLatitude::planetographic) return normal(p);
        return normalized(map_latitude_ == MapLatitude::planetocentric ? p : p * scale_to_sphere_);
    }

    /// Texture coordinates of a point with this direction on a map: u is its longitude from +x towards +y, v its
    /// latitude, 1 at +z.
    [[nodiscard]] static std::array<double, 2> uv(const Vec3& n) noexcept {
        const double colatitude = std::atan2(std::hypot(n.x, n.y), n.z), longitude = std::atan2(n.y, n.x);
        const double u = longitude / (2 * std::numbers::pi);
        return {u < 0 ? u + 1 : u, 1 - colatitude / std::numbers::pi};
    }

private:
    std::uint32_t nearest(const ShapeRays& rays, std::uint32_t wanted, ShapeHits& hits) const noexcept;
    void fill_surface(const ShapeHits& found, HitBatch& hits) const noexcept;

    Vec3 semi_axes_m_;
    double radius_m_;       ///< largest semi-axis
    Vec3 scale_to_sphere_;  ///< scale to the sphere: radius over semi-axes
    int material_;
    bool textured_;
    MapLatitude map_latitude_;
};

inline constexpr TableKey kSphereRows[]{{"radius_m", rows::number(kShapeLength), "a number > 0"}};
inline constexpr TableKey kEllipsoidRows[]{
    {"semi_axes_m", rows::vec3(kShapeLength), "[a, b, c], the half lengths along the body's x, y and z"}};
/// `values`: a radius, or three semi-axes.
[[nodiscard]] std::shared_ptr<const Shape> make_ellipsoid(std::span<const double> values, int material,
                                                          std::optional<MapLatitude> maps);
[[nodiscard]] Vec3 ellipsoid_axes_m(std::span<const double> values);
inline constexpr ShapeKind kSphere{.name = "sphere",
                                   .example = "{radius_m = ...}",
                                   .keys = {.rows = kSphereRows},
                                   .expected = "the radius of a sphere is a positive length in metres",
                                   .make = make_ellipsoid,
                                   .semi_axes_m = ellipsoid_axes_m};
inline constexpr ShapeKind kEllipsoid{
    .name = "ellipsoid",
    .example = "{semi_axes_m = [a, b, c]}",
    .keys = {.rows = kEllipsoidRows},
    .expected = "the semi-axes of an ellipsoid are three positive lengths in metres",
    .make = make_ellipsoid,
    .semi_axes_m = ellipsoid_axes_m};

[[nodiscard]] inline ExactShape exact_sphere(double radius_m, int material = 0) {
    return {&kSphere, {radius_m}, material};
}
/// (x/a)^2 + (y/b)^2 + (z/c)^2 = 1.
[[nodiscard]] inline ExactShape exact_ellipsoid(const Vec3& semi_axes_m, int material = 0) {
    return {&kEllipsoid, {semi_axes_m.x, semi_axes_m.y, semi_axes_m.z}, material};
}

}  // namespace narpa
