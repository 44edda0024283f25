/// bench/embree/raw_embree.h - the lower bound of a frame's cost: Embree's batch calls on its rays, and nothing
/// else. Primary rays sixteen at a time, 4 x 4 pixels together; then, tile by tile, shadow rays from the hits that
/// face the Sun, packed; all with the coherent flag. Setting up the rays and reading back the hits is part of the
/// time; there is no shading.
#pragma once

#include <cstdint>
#include <functional>

#include "base/result.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

struct RawCost {
    /// Wall time, divided in proportion to what the threads spent.
    double primary_s = 0, shadow_s = 0;
    std::uint64_t primaries = 0, hits = 0, shadow_rays = 0, shadowed = 0;
    [[nodiscard]] double seconds() const noexcept { return primary_s + shadow_s; }
};

/// Traces the rays through all pixel centres, and from their hits to the Sun's centre in direction `to_sun` (unit,
/// world). On the calling thread's TBB arena.
using RawFrame = std::function<RawCost(const Camera& camera, const Rigid3& T_world_camera, const Vec3& to_sun)>;

/// Of a scene whose bodies are meshes and stay at `at`; else an Error.
[[nodiscard]] Result<RawFrame> raw_embree(const Scene& scene, const BodyPoses& at);

}  // namespace narpa
