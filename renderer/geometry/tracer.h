/// renderer/geometry/tracer.h - traces rays through a scene.
///
/// Each body's shape is built once, in its own frame. A ray is transformed to that frame in double, its origin
/// advanced to the body's bounding sphere, and its range stays double: an error of 0.3 um at any distance, where
/// Embree's own instances (float) are off by 0.2 m at 6778 km. Bodies move by other BodyPoses; nothing is rebuilt.
///
/// Rays among many bodies find them in a tree over their bounding spheres (BodyTree), in double as well, if the
/// poses were arranged; a few are tried one by one.
///
/// All queries are thread-safe and allocate nothing.
#pragma once

#include <memory>
#include <span>

#include "base/result.h"
#include "renderer/geometry/body_poses.h"
#include "renderer/geometry/ray_batch.h"
#include "renderer/geometry/shape.h"
#include "renderer/scene/scene.h"

namespace narpa {

class Tracer {
public:
    /// `scene` must outlive the tracer. `threads` bounds the threads that build; 0 is all.
    static Result<Tracer> create(const Scene& scene, int threads = 0);
    template <class... Rest>
    static Result<Tracer> create(const Scene&& temporary, Rest&&...) = delete;
    Tracer(Tracer&&) noexcept;
    Tracer& operator=(Tracer&&) noexcept;
    ~Tracer();

    /// Builds the tree of these poses, where there are more than BodyTree::kFewBodies. Without it, and after a
    /// change of the poses, all queries find the same, in a time proportional to the number of bodies.
    void arrange(BodyPoses& at) const noexcept;
    /// The tree, if these poses were arranged; else null.
    [[nodiscard]] const BodyTree* tree(const BodyPoses& at) const noexcept;

    /// Nearest hits with 0 <= range, of rays that run close together, as those of neighbouring pixels or of a
    /// LiDAR's firing do; they may start anywhere. Only these `bodies` are tried: those that the rays may hit.
    void intersect(const BodyPoses& at, const RayBatch& rays, std::span<const std::uint32_t> bodies,
                   HitBatch& hits) const noexcept;
    /// Nearest hits of rays that leave surfaces, each from its point on the side of its geometric normal, in any
    /// unit direction, at the moment of its point. Only lanes whose bit is set in `wanted` are traced, and only
    /// those of `hits` have defined values. The start is offset along the normal by the bound of the rounding error
    /// in that body's own frame, and kept a few times that far from the edges of its face, so that a surface never
    /// shadows itself and nothing farther off is skipped; ranges are measured from there. A direction below the
    /// horizon of its own surface meets that surface at once. Rays that leave the inner side of a closed mesh or an
    /// ellipsoid meet it again from inside. `hits` may be `from`.
    void intersect(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                   std::uint32_t wanted, HitBatch& hits) const noexcept;
    /// Shadow rays of infinite length: the lanes of `wanted` whose ray, which starts as above, hits any surface.
    /// Fastest if the directions are nearly equal, as to the Sun.
    [[nodiscard]] std::uint32_t occluded(const BodyPoses& at, const SurfacePoints& from,
                                         const Vec3Lanes& directions, std::uint32_t wanted) const noexcept;
    /// Shadow rays of finite length: t_max[i] metres from the start.
    [[nodiscard]] std::uint32_t occluded(const BodyPoses& at, const SurfacePoints& from,
                                         const Vec3Lanes& directions, const Lanes<double>& t_max,
                                         std::uint32_t wanted) const noexcept;

    /// A batch of one ray: the nearest hit with 0 <= range < t_max among all bodies but `skip_body` (-1: none).
    [[nodiscard]] Hit intersect(const BodyPoses& at, const Ray& ray, double t_max,
                                int skip_body = -1) const noexcept;
    /// A batch of one shadow ray.
    [[nodiscard]] bool occluded(const BodyPoses& at, const Hit& from, const Vec3& direction,
                                double t_max) const noexcept;

    /// In world axes.
    [[nodiscard]] TextureFrame texture_frame(const BodyPoses& at, const Hit& hit) const noexcept;
    /// Shape::vertex_colour.
    [[nodiscard]] Rgb vertex_colour(const BodyPoses& at, const Hit& hit) const noexcept;

    [[nodiscard]] const Shape& shape(std::size_t body) const noexcept;
    /// An ellipsoid that holds the body.
    [[nodiscard]] const BodyBounds& bounds(std::size_t body) const noexcept {
        return shape(body).properties().bounds;
    }
    /// Radius of the body's bounding sphere about its own origin, metres.
    [[nodiscard]] double bounding_radius_m(std::size_t body) const noexcept {
        return shape(body).properties().radius_m;
    }
    /// The indices of all bodies: for rays that may hit any body.
    [[nodiscard]] std::span<const std::uint32_t> all_bodies() const noexcept;
    /// The indices of the BodyTree::kFewBodies bodies with the largest bounding spheres, or of all; ascending.
    [[nodiscard]] std::span<const std::uint32_t> largest_bodies() const noexcept;
    [[nodiscard]] std::size_t triangle_count() const noexcept;
    [[nodiscard]] const Scene& scene() const noexcept;

private:
    struct Impl;
    explicit Tracer(std::unique_ptr<Impl>);
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
