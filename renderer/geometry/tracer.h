/// renderer/geometry/tracer.h - rays into a scene.
///
/// Each body's triangles stand in an Embree scene of their own, in the body's frame, in robust mode, built once.
/// A ray enters that frame in double, its origin advanced to the body's bounding sphere, and its range stays
/// double: 0.3 um at any distance, where Embree's own instances (float) lose 0.2 m at 6778 km. Spheres and
/// ellipsoids are solved in double. Bodies move by handing other poses to `place`; nothing is ever rebuilt.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "renderer/geometry/body_bounds.h"
#include "renderer/geometry/lanes.h"
#include "renderer/scene/scene.h"

namespace narpa {

struct Ray {
    Vec3 origin{};
    Vec3 direction{};  ///< unit
};

/// The nearest surface along a ray. `body` < 0: nothing was hit and the rest is undefined.
struct Hit {
    int body = -1;
    std::uint32_t face = 0;   ///< triangle of the mesh; 0 on a sphere
    double range_m = 0;       ///< from the ray's origin
    Vec3 position{};          ///< world, metres
    Vec3 geometric_normal{};  ///< world, unit, towards the ray's origin
    Vec3 shading_normal{};    ///< world, unit, same side
    float u = 0, v = 0;       ///< texture coordinates; 0 where the material has no texture
    int material = 0;         ///< index into Scene::materials
    bool outside = true;      ///< the ray came from the outer side, by the winding of the face
    Vec3 departure_body{};    ///< body frame: where rays that leave start, before the offset for rounding: the
                              ///< position, or above it on the smooth surface that vertex normals describe
    Vec3 beyond_body{};       ///< the same for rays that leave on the other side
};

/// Up to kLanes rays side by side. Lanes from `n` on are not looked at.
struct RayBatch {
    std::size_t n = 0;
    Vec3Lanes origin, direction;  ///< direction: unit

    [[nodiscard]] Ray operator[](std::size_t i) const { return {origin[i], direction[i]}; }
    void put(std::size_t i, const Ray& ray) { origin.put(i, ray.origin), direction.put(i, ray.direction); }
};

/// Points of surfaces that rays leave: the members of Hit that say where such a ray starts, lane by lane.
struct SurfacePoints {
    std::uint32_t outside = 0;  ///< a bit for each lane
    Lanes<int> body;
    Lanes<std::uint32_t> face;
    Vec3Lanes departure_body;

    void put(std::size_t i, const Hit& hit);
    /// Copies lane j of another batch.
    void put(std::size_t i, const SurfacePoints& from, std::size_t j);
};

/// The nearest surface along each ray of a batch: the members of Hit, lane by lane. Where the lane's bit in `met`
/// is not set, `body` is -1 and the rest is undefined.
struct HitBatch : SurfacePoints {
    std::uint32_t met = 0;
    Lanes<double> range_m;
    Vec3Lanes position, geometric_normal, shading_normal;
    Lanes<float> u, v;
    Lanes<int> material;
    Vec3Lanes beyond_body;

    [[nodiscard]] Hit operator[](std::size_t i) const;
    void put(std::size_t i, const Hit& hit);
};

/// The same point, left on its other side: for light that goes through.
[[nodiscard]] Hit other_side(const Hit& hit) noexcept;

/// How the surface lies under its texture at a hit: world metres per unit of u and of v, along the surface. Zero
/// where there are no texture coordinates.
struct TextureFrame {
    Vec3 dp_du{}, dp_dv{};
};

/// Where every body is at one instant. Reused from frame to frame: no allocation after the first `place`.
class BodyPoses {
public:
    explicit BodyPoses(std::size_t bodies) : T_world_body(bodies) {}
    void set(std::size_t body, const Rigid3& T) { T_world_body[body] = T; }

    std::vector<Rigid3> T_world_body;
};

class Tracer {
public:
    /// `scene` must outlive the tracer. `threads` bounds the threads that build; 0 is all.
    static Result<Tracer> create(const Scene& scene, int threads = 0);
    Tracer(Tracer&&) noexcept;
    Tracer& operator=(Tracer&&) noexcept;
    ~Tracer();

    /// Nearest hit with 0 <= range < t_max. Thread-safe, allocates nothing. `skip_body` is looked through; -1:
    /// none.
    [[nodiscard]] Hit intersect(const BodyPoses& at, const Ray& ray, double t_max,
                                int skip_body = -1) const noexcept;
    /// Is anything between the surface point and the distance t_max in this direction? `from` is the hit that
    /// the ray leaves on the side of its geometric normal; the start is lifted by the bound of the rounding error
    /// in that body's own frame, and kept as far from the edges of its face as a few times that, so that a surface
    /// never shadows itself and nothing further off is skipped.
    [[nodiscard]] bool occluded(const BodyPoses& at, const Hit& from, const Vec3& direction,
                                double t_max) const noexcept;

    /// Rays that run close together, as those of neighbouring pixels do, or of a LiDAR's firing: the nearest hit of
    /// each as above with no end, several times faster. They may start anywhere. Only these `bodies` are looked at:
    /// those that the rays may meet.
    void intersect(const BodyPoses& at, const RayBatch& rays, std::span<const std::uint32_t> bodies,
                   HitBatch& hits) const noexcept;
    /// Nearest hits of rays that leave surfaces, each from its point on the side of its geometric normal, in any
    /// unit direction, without an end. Only lanes whose bit is set in `wanted` are traced, and only those of `hits`
    /// have defined values. The start is lifted as for `occluded`, and ranges count from there. A direction below
    /// the horizon of its own surface meets that surface at once. Rays that leave the inner side of a closed mesh,
    /// a sphere or an ellipsoid meet it again from inside. Rays need not run close together. `hits` may be `from`.
    void intersect(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                   std::uint32_t wanted, HitBatch& hits) const noexcept;
    /// Shadow rays without an end: the lanes of `wanted` whose ray meets any surface. Fastest where the directions
    /// are nearly the same, as to the Sun.
    [[nodiscard]] std::uint32_t occluded(const BodyPoses& at, const SurfacePoints& from,
                                         const Vec3Lanes& directions, std::uint32_t wanted) const noexcept;
    /// Shadow rays with ends: t_max[i] metres from the start.
    [[nodiscard]] std::uint32_t occluded(const BodyPoses& at, const SurfacePoints& from,
                                         const Vec3Lanes& directions, const Lanes<double>& t_max,
                                         std::uint32_t wanted) const noexcept;

    /// Which of up to kLanes hits cannot see their light, each in a direction of its own without an end: a bit
    /// each. Only those whose bit is set in `wanted` are asked.
    [[nodiscard]] std::uint32_t occluded(const BodyPoses& at, std::span<const Hit> from,
                                         std::span<const Vec3> directions, std::uint32_t wanted) const noexcept;

    /// Nearest hits of rays that leave surfaces, each from its hit on the side of its geometric normal, in any
    /// direction, without an end; only those whose bit is set in `wanted` are asked, and only their `hits` written.
    /// The start is lifted as for `occluded`, and ranges count from there. A direction below the horizon of its own
    /// surface meets that surface at once. Rays that leave the inner side of a closed mesh, a sphere or an
    /// ellipsoid meet it again from inside. Rays need not run close together. `hits` may be `from`'s own array.
    void intersect(const BodyPoses& at, std::span<const Hit> from, std::span<const Vec3> directions,
                   std::uint32_t wanted, std::span<Hit> hits) const noexcept;
    /// As the packet above, each ray with an end of its own: t_max[i] metres.
    [[nodiscard]] std::uint32_t occluded(const BodyPoses& at, std::span<const Hit> from,
                                         std::span<const Vec3> directions, std::span<const double> t_max,
                                         std::uint32_t wanted) const noexcept;

    [[nodiscard]] TextureFrame texture_frame(const BodyPoses& at, const Hit& hit) const noexcept;

    /// An ellipsoid that holds the body.
    [[nodiscard]] const BodyBounds& bounds(std::size_t body) const noexcept;
    /// Radius of the body's bounding sphere about its own origin, metres.
    [[nodiscard]] double bounding_radius_m(std::size_t body) const noexcept;
    /// 0, 1, 2 ...: for rays that may meet any body.
    [[nodiscard]] std::span<const std::uint32_t> all_bodies() const noexcept;
    [[nodiscard]] std::size_t triangle_count() const noexcept;
    [[nodiscard]] const Scene& scene() const noexcept;

private:
    struct Impl;
    explicit Tracer(std::unique_ptr<Impl>);
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
