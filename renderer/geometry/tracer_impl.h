/// renderer/geometry/tracer_impl.h - what a Tracer holds, for its own source files.
#pragma once

#include <bit>
#include <limits>
#include <vector>

#include "renderer/geometry/ellipsoid.h"
#include "renderer/geometry/mesh_scene.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

struct WorldRays;

/// Rays by the body that they meet, or leave.
class BodyGroups {
public:
    struct Group {
        std::size_t body;
        std::uint32_t rays;
    };
    BodyGroups(const Lanes<int>& body, std::uint32_t rays) noexcept {
        for (std::uint32_t rest = rays; rest != 0; rest &= ~groups_[n_++].rays) {
            const int first = body[static_cast<std::size_t>(std::countr_zero(rest))];
            groups_[n_] = {static_cast<std::size_t>(first), lanes_with(body, first) & rest};
        }
    }
    [[nodiscard]] const Group* begin() const { return groups_.data(); }
    [[nodiscard]] const Group* end() const { return groups_.data() + n_; }

private:
    Lanes<Group> groups_;
    std::size_t n_ = 0;
};

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
    void finish(const BodyPoses& at, const Meeting& met, Hit& hit) const noexcept;
    void finish_mesh(const Rigid3& T_world_body, const Meeting& met, Hit& hit) const noexcept;
    void finish_exact(const Rigid3& T_world_body, const Meeting& met, Hit& hit) const noexcept;

    /// The nearest surface that each ray of a packet has met so far.
    struct Found {
        std::uint32_t met = 0;
        Lanes<int> body;  ///< -1: none
        MeshHits at;  ///< of an exact shape: range, direction, position and `inner`; nothing met: infinite range
    };
    void finish(const BodyPoses& at, const Found& found, HitBatch& hits) const noexcept;
    void finish_on_meshes(const BodyPoses& at, const Found& found, const BodyGroups& groups,
                          HitBatch& hits) const noexcept;

    class Leaving;
    /// Nearest hits of the packet's rays whose bit is set in `wanted`, among these bodies.
    void nearest_hits(const BodyPoses& at, const WorldRays& rays, std::uint32_t wanted,
                      std::span<const std::uint32_t> bodies, Found& found) const noexcept;
    /// Asks one body.
    void look_at(const BodyPoses& at, const WorldRays& rays, std::uint32_t body, std::uint32_t asked,
                 MeshRays& local, Found& found) const noexcept;
    /// Those of `wanted` that cannot see as far as `t_max`.
    [[nodiscard]] std::uint32_t hidden(const BodyPoses& at, const WorldRays& rays, const Lanes<double>& t_max,
                                       std::uint32_t wanted) const noexcept;

    /// Where a ray starts that leaves the hit, in the frame of its body.
    [[nodiscard]] Vec3 departure(const Hit& from) const noexcept;
    /// Does this exact shape hide what lies at t_max? `start` is in the frame of the body that the ray leaves,
    /// `start_turned` the same turned into the world's axes.
    [[nodiscard]] bool exact_hides(const BodyPoses& at, std::size_t body, const Hit& from, const Vec3& start,
                                   const Vec3& start_turned, const Vec3& direction, double t_max) const noexcept;
};

inline Vec3 to_body(const Quat& q_world_body, const Vec3& v) noexcept {
    return conjugate(q_world_body) * v;
}

}  // namespace narpa
