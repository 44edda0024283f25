/// bench/embree/raw_embree_scene.h - all triangles of a scene in one Embree scene, as plain as Embree takes them:
/// world axes, single precision, no instances, default build. The baseline for narpa's own tracer.
#pragma once

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <vector>

#include "base/lanes.h"
#include "base/result.h"
#include "renderer/geometry/embree.h"
#include "renderer/geometry/tracer.h"
#include "renderer/scene/scene.h"

namespace narpa {

struct RawScene {
    embree::Owned<RTCDevice> device;
    embree::Owned<RTCScene> scene;
    const Vec3f* vertices = nullptr;           ///< world, metres; Embree's own
    const std::uint32_t* corners = nullptr;    ///< three for each triangle
    std::vector<std::uint16_t> face_material;  ///< index into Scene::materials

    /// An Error for bodies that are not made of triangles.
    static Result<RawScene> build(const Scene& scene, const BodyPoses& at);
};

/// The camera's axes for rays o + z (x X + y Y + Z), which are not unit: z is the depth.
struct RawAim {
    Vec3f origin, across, down, ahead;  ///< across and down: one pixel on; ahead: the pixel (0, 0)
    RawAim(const Camera& camera, const Rigid3& T_world_camera);
};

inline constexpr int kRawTile = 32;  ///< pixels a side: what one task does
using RawTile = tbb::blocked_range2d<int>;

/// Calls `work(tile)` for tiles of the image. On the calling thread's TBB arena.
template <class Work>
void over_raw_tiles(const Camera& camera, const Work& work) {
    tbb::parallel_for(RawTile(0, camera.height, kRawTile, 0, camera.width, kRawTile), work,
                      tbb::simple_partitioner());
}

}  // namespace narpa
