/// bench/embree/reference_loop.h - a plain renderer to compare narpa's with: a straightforward loop over Embree.
/// Sixteen rays at a time; the same number of samples for each pixel, jittered in strata; counter-based random
/// numbers; Lambert and Phong; Sun with shadows; paths with cosine-distributed directions and next-event estimation
/// of the Sun and one emissive surface. No adaptive sampling, no low-discrepancy points.
///
/// It converges to narpa's image of the same scene, which is what makes their times at equal error comparable.
#pragma once

#include <cstdint>
#include <functional>

#include "base/result.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// Uses these settings: spp (jittered in the pixel, also a single one), seed, frame, method, max_depth. Returns the
/// number of rays. On the calling thread's TBB arena; same bytes on any number of threads.
using ReferenceLoop = std::function<std::uint64_t(const Camera& camera, const Rigid3& T_world_camera,
                                                  const FrameSettings& settings, RadianceImage& out)>;

/// Supports meshes of flat faces, Lambert and Phong without textures, Sun, ambient and emissive surfaces; an Error
/// for anything else. `scene` outlives it; the bodies stay where `at` has them now.
[[nodiscard]] Result<ReferenceLoop> reference_loop(const Scene& scene, const BodyPoses& at);

}  // namespace narpa
