/// renderer/geometry/shape.h - interface of a body's surface to the ray tracer.
///
/// A kind of shape is a class derived from Shape, in its own files; those that scenes name: shape_kind.h.
/// Everything here is in the frame of the body, in metres. One virtual call serves a batch of rays.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "renderer/geometry/ray_batch.h"
#include "renderer/geometry/triangle.h"
#include "renderer/material/texture/texture_lookup.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Rays in the body's frame. All lanes hold finite numbers, also those that are not traced.
struct ShapeRays {
    Vec3Lanes origin, direction;  ///< at any distance; unit
    Lanes<double> entry_m;        ///< where the ray enters the sphere of `bound_m`; at most 0 from inside
    Lanes<double> t_max;
    std::uint32_t leaving = 0;  ///< lanes whose ray starts on this shape, at a point from `depart`
    std::uint32_t inside = 0;   ///< those of them that leave its inner side
    bool coherent = false;      ///< the rays run close together, as those of neighbouring pixels do
};

/// The nearest hits so far. A shape writes `range_m`, `face`, `inner` and whatever else its own `surface` reads.
struct ShapeHits {
    std::uint32_t inner = 0;  ///< lanes known to hit the inner side
    Lanes<std::uint32_t> face;
    Lanes<double> range_m;  ///< from the ray's origin
    Vec3Lanes direction, position;
    Lanes<double> b1, b2;    ///< barycentric weights of a triangle's second and third corner
    TriangleLanes triangle;  ///< where the shape has triangles

    [[nodiscard]] TrianglePoint point(std::size_t i) const { return {position[i], b1[i], b2[i]}; }
};

/// Derivatives of the surface position by the texture coordinates u and v, metres. Zero without texture
/// coordinates.
struct TextureFrame {
    Vec3 dp_du{}, dp_dv{};
};

/// An ellipsoid that holds a body and fits it loosely, its axes along the body's.
struct BodyBounds {
    Vec3 centre_m{};
    Vec3 semi_axes_m{1, 1, 1};
};

inline constexpr std::size_t kBoxLeaves = 4096;  ///< most leaves of a shape's tree of boxes
/// Fraction of a mesh's size by which Embree's rays, in single precision, may miss an edge and still hit it.
inline constexpr double kEmbreeSlack = 4e-6;

/// A box along the body's axes.
struct BoxNode {
    std::array<float, 3> low{}, high{};
    std::uint32_t children = 0;  ///< index of the first of two; 0: a leaf
};

/// Position of an emissive body relative to a receiver of its light. The vector from the receiver to the body's
/// origin is `apart - offset`, metres, world axes, stored in two parts so that a common offset of the whole scene
/// cancels.
struct EmitterView {
    Quat q_world_body{};
    Vec3 apart{}, offset{};
    Vec3 up{};         ///< unit, world axes; only light from this hemisphere counts
    bool own = false;  ///< the receiver is a point of the body's own surface

    /// From the receiver to a point of the body's frame, world axes.
    [[nodiscard]] Vec3 way_to(const Vec3& point_body) const { return apart + (q_world_body * point_body - offset); }
    [[nodiscard]] Vec3 to_body(const Vec3& v) const { return conjugate(q_world_body) * v; }
};

/// Light emitted by a shape from both its sides, for next-event estimation. In the body's frame.
class EmissiveSurface {
public:
    virtual ~EmissiveSurface() = default;
    EmissiveSurface() = default;
    EmissiveSurface(const EmissiveSurface&) = delete;
    EmissiveSurface& operator=(const EmissiveSurface&) = delete;

    struct Properties {
        Vec3 centre_m{};      ///< centre of a sphere that holds the emissive surface
        double radius_m = 0;  ///< of that sphere
        double power = 0;     ///< mean band of radiance times area, W/sr
    };
    [[nodiscard]] const Properties& properties() const noexcept { return properties_; }

    /// False where sampling is useless: the light cannot reach the receiver, or every ray hits the surface.
    [[nodiscard]] virtual bool is_worth_sampling(const EmitterView&) const noexcept { return true; }
    struct Sample {
        Vec3 direction{};        ///< world, unit, from the receiver; not finite: no light can arrive
        std::uint32_t face = 0;  ///< only light from this face counts
    };
    [[nodiscard]] virtual Sample sample(const EmitterView& view, double choice, double u,
                                        double v) const noexcept = 0;
    /// Density per solid angle with which `sample` generates the direction of a ray from the receiver that has this
    /// hit.
    [[nodiscard]] virtual double pdf(const EmitterView& view, const Vec3& direction,
                                     const Hit& met) const noexcept = 0;

protected:
    Properties properties_;
};

class Shape {
public:
    struct Properties {
        double radius_m = 0;  ///< of a sphere about the body's origin that holds the shape
        double bound_m = 0;   ///< slightly larger, so that rounding cannot cut off the limb
        BodyBounds bounds{};
        double resolution_m = 0;  ///< surfaces closer together than this cannot be told apart
        bool convex = false;      ///< a ray that leaves its outer side never meets it again
        TextureLayout texture_layout = TextureLayout::flat;
        std::size_t triangles = 0;
    };

    virtual ~Shape() = default;
    Shape(const Shape&) = delete;
    Shape& operator=(const Shape&) = delete;
    [[nodiscard]] const Properties& properties() const noexcept { return properties_; }

    /// Nearest hits with 0 <= range < t_max. Returns those of the `wanted` lanes that have one; other lanes of
    /// `hits` stay as they were.
    virtual std::uint32_t intersect(const ShapeRays& rays, std::uint32_t wanted,
                                    ShapeHits& hits) const noexcept = 0;
    /// Those of the `wanted` lanes that meet the shape before t_max.
    [[nodiscard]] virtual std::uint32_t occluded(const ShapeRays& rays, std::uint32_t wanted) const noexcept = 0;
    /// The surface at hits of `wanted` lanes: position, both normals (on the side of the ray's origin), departure,
    /// beyond, outside, texture coordinates, material. Positions and normals are still in the body's frame. Other
    /// lanes may be overwritten.
    virtual void surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept = 0;
    /// Starts of rays that leave, offset so that rounding cannot move them through the surface; by default the
    /// points themselves. Other lanes of `starts` stay as they were.
    virtual void depart(const SurfacePoints& points, std::uint32_t wanted, Vec3Lanes& starts) const noexcept {
        for_each_lane(wanted, [&](std::size_t i) { starts.put(i, points.departure_body[i]); });
    }
    /// In the body's frame.
    [[nodiscard]] virtual TextureFrame texture_frame(const Hit& hit) const noexcept = 0;
    /// Mesh::colours at a hit, linear between the corners; white without.
    [[nodiscard]] virtual Rgb vertex_colour(std::uint32_t /*face*/, const Vec3& /*position_body*/) const noexcept {
        return {1, 1, 1};
    }
    /// A tree of boxes whose leaves hold the surface, root first; empty: the ellipsoid of `bounds` fits it best.
    /// Built at the first call, by any thread, and cached.
    [[nodiscard]] virtual std::span<const BoxNode> boxes() const { return {}; }
    /// Null if no material is emissive. The scene must outlive it.
    [[nodiscard]] virtual std::unique_ptr<const EmissiveSurface> emission(const Scene&) const { return nullptr; }

protected:
    Shape() = default;
    Properties properties_;
};

}  // namespace narpa
