/// bench/raw_embree.h - the limit of what a frame can cost: Embree's packet calls on a frame's rays, and
/// nothing else. Primaries are asked sixteen at a time, 4 x 4 pixels together; then, tile by tile, shadow rays from
/// the hits that face the Sun, packed; all with the coherent flag. Setting up the rays and reading back what they
/// meet is part of the time; there is no shading.
#pragma once

#include <cstdint>
#include <memory>

#include "base/result.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

struct RawCost {
    /// Wall time, shared out as the threads have spent it.
    double primary_s = 0, shadow_s = 0;
    std::uint64_t primaries = 0, hits = 0, shadow_rays = 0, shadowed = 0;
    [[nodiscard]] double seconds() const noexcept { return primary_s + shadow_s; }
};

class RawEmbree {
public:
    /// The bodies stay where `at` has them. Only meshes.
    static Result<RawEmbree> create(const Scene& scene, const BodyPoses& at);
    RawEmbree(RawEmbree&&) noexcept;
    ~RawEmbree();

    /// The rays through all pixels' middles, and from what they meet to the middle of the Sun, which shines from
    /// `to_sun` (unit, world). On the calling thread's TBB arena.
    [[nodiscard]] RawCost trace(const Camera& camera, const Rigid3& T_world_camera, const Vec3& to_sun) const;

private:
    struct Impl;
    explicit RawEmbree(std::unique_ptr<Impl>);
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
