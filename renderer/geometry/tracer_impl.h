/// renderer/geometry/tracer_impl.h - the parts of a Tracer, for its own source files.
#pragma once

#include <vector>

#include "renderer/geometry/embree.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

/// One for each body; bodies with the same mesh share theirs.
using Shapes = std::vector<std::shared_ptr<const Shape>>;

/// The scene must outlive the shapes. `threads` bounds the threads that build; 0 is all.
[[nodiscard]] Result<Shapes> make_shapes(const Scene& scene, RTCDevice device, int threads);

struct WorldRays;
struct NearestHits;

inline constexpr std::uint32_t kNoBody = ~0u;

struct Tracer::Impl {
    const Scene* scene = nullptr;
    embree::Owned<RTCDevice> device;  // outlives the shapes
    Shapes shapes;                    ///< one for each body
    std::vector<std::uint32_t> all_bodies, largest_bodies;

    Status build(const Scene& s, int threads);

    [[nodiscard]] bool in_tree(const BodyPoses& at) const noexcept { return at.tree().belongs_to(this); }

    class SecondaryRays;
    /// Nearest hits of the `wanted` lanes among these bodies.
    void find_nearest(const BodyPoses& at, const WorldRays& rays, std::uint32_t wanted,
                      std::span<const std::uint32_t> bodies, NearestHits& nearest) const noexcept;
    /// Where the rays enter the bounds of a body; infinity: nowhere.
    void enter_body(const BodyPoses& at, const WorldRays& rays, std::uint32_t body,
                    Lanes<double>& entry_m) const noexcept;
    void trace_body(const BodyPoses& at, const WorldRays& rays, std::uint32_t body, std::uint32_t wanted,
                    ShapeRays& local, NearestHits& nearest) const noexcept;
    /// The `wanted` lanes whose rays from these points meet any body before `t_max`.
    [[nodiscard]] std::uint32_t find_occluded(const BodyPoses& at, const SurfacePoints& from,
                                              const Vec3Lanes& directions, const Lanes<double>& t_max,
                                              std::uint32_t wanted, bool coherent) const noexcept;
    // The same for all bodies, where the poses have a tree (trace_tree.cpp).
    /// `skip`: a body to leave out; kNoBody: none.
    void find_nearest_in_tree(const BodyPoses& at, const WorldRays& rays, std::uint32_t wanted, std::uint32_t skip,
                              NearestHits& nearest) const noexcept;
    /// `done`: a body that is known not to occlude rays that leave it.
    [[nodiscard]] std::uint32_t find_occluded_in_tree(const BodyPoses& at, const WorldRays& rays,
                                                      const Lanes<double>& t_max, std::size_t done,
                                                      std::uint32_t wanted) const noexcept;
    [[nodiscard]] Hit intersect_others(const BodyPoses& at, const Ray& ray, std::uint32_t skip) const noexcept;
    /// The `wanted` lanes that meet a body before `t_max`.
    [[nodiscard]] std::uint32_t occluded_by(const BodyPoses& at, const WorldRays& rays, std::uint32_t body,
                                            std::uint32_t wanted, ShapeRays& local) const noexcept;
    /// The surfaces at the nearest hits, in the world.
    void finish(const BodyPoses& at, const WorldRays& rays, const NearestHits& nearest,
                HitBatch& hits) const noexcept;
};

}  // namespace narpa
