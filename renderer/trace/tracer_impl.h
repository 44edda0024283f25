/// renderer/trace/tracer_impl.h - what a Tracer holds, for its own source files.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "renderer/trace/ellipsoid.h"
#include "renderer/trace/lights.h"
#include "renderer/trace/mesh_scene.h"
#include "renderer/trace/tracer.h"

namespace narpa {

struct Tracer::Impl {
    struct Shape {
        const MeshScene* mesh = nullptr;      ///< null: an exact shape
        EllipsoidShape exact{Vec3{1, 1, 1}};  ///< in use where there is no mesh
        bool turned = true;                   ///< an exact shape that its body's attitude changes: not a sphere
        double radius_m = 0;                  ///< about the body's origin: of what holds the shape
        double bound_m = 0;                   ///< a little more, so that rounding cannot cut off the limb
        int material = 0;                     ///< of an exact shape
    };

    const Scene* scene = nullptr;
    embree::Owned<RTCDevice> device;  // outlives the scenes below
    std::vector<MeshScene> meshes;
    std::vector<Shape> shapes;       ///< one for each body
    std::vector<BodyBounds> bounds;  ///< one for each body
    std::vector<std::uint32_t> all_bodies;
    std::vector<std::uint8_t> textured;  ///< per material: does it look at texture coordinates?
    std::optional<Lights> lights;

    Status build(const Scene& s, int threads);
    [[nodiscard]] Result<Shape> shape_for(const Body& body) const;
    [[nodiscard]] const Shape& shape_of(const Hit& hit) const noexcept {
        return shapes[static_cast<std::size_t>(hit.body)];
    }

    /// Where a ray, in the frame of the body that it meets, meets it.
    struct Meeting {
        Vec3 origin{}, direction{};
        MeshHit mesh{};       ///< of a mesh
        bool outside = true;  ///< of an exact shape: met from the outer side
    };
    /// Fills in what follows from the hit's body and range.
    void finish(const Placement& at, const Meeting& met, Hit& hit) const noexcept;
    void finish_mesh(const Rigid3& T_world_body, const Meeting& met, Hit& hit) const noexcept;
    void finish_exact(const Rigid3& T_world_body, const Meeting& met, Hit& hit) const noexcept;
    /// Nearest hits of the packet's rays whose bit is set in `wanted`, and of no others.
    template <class Rays>
    void nearest_hits(const Placement& at, const Rays& rays, std::uint32_t wanted,
                      std::span<Hit> hits) const noexcept;
    /// Those of `wanted` that cannot see as far as t_max(i).
    template <class End>
    [[nodiscard]] std::uint32_t hidden(const Placement& at, std::span<const Hit> from,
                                       std::span<const Vec3> directions, std::uint32_t wanted,
                                       const End& t_max) const noexcept;
    class LeavingRays;

    /// Where a ray starts that leaves the hit, in the frame of its body.
    [[nodiscard]] Vec3 departure(const Hit& from) const noexcept;
    /// Does this exact shape hide what lies at t_max? `start` is in the frame of the body that the ray leaves,
    /// `start_turned` the same turned into the world's axes.
    [[nodiscard]] bool exact_hides(const Placement& at, std::size_t body, const Hit& from, const Vec3& start,
                                   const Vec3& start_turned, const Vec3& direction, double t_max) const noexcept;
};

inline Vec3 to_body(const Quat& q_world_body, const Vec3& v) noexcept {
    return conjugate(q_world_body) * v;
}

}  // namespace narpa
