/// tests/renderer/lidar/lidar_support.h - shots of a LiDAR at the world's origin.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "renderer/lidar/lidar_receiver.h"
#include "renderer/light/render_scene.h"
#include "tests/support/shapes.h"

namespace narpa::test {

struct ShotOptions {
    std::uint64_t seed = 1;
    const LidarMedium* medium = nullptr;
    std::span<const Motion> motions{};
    double range_max_m = 1e4;
};

/// `n` shots along a direction, with all bodies where the scene puts them at time 0.
inline std::vector<LidarEchoes> shots_along(const Vec3& direction, const RenderScene& render_scene,
                                            const LidarReceiverModel& model, std::size_t n,
                                            const ShotOptions& options = {}) {
    Lidar lidar;
    lidar.range_max_m = options.range_max_m;
    lidar.receiver = model;
    LidarReceiver receiver(render_scene.tracer(), lidar, options.seed, 0);
    receiver.set_medium(options.medium);
    const BodyPoses at = placed(render_scene.scene());
    std::vector<LidarEchoes> out(n);
    for (std::size_t first = 0; first < n; first += kLanes) {
        RayBatch beams;
        for (; beams.n < std::min(kLanes, n - first); ++beams.n) beams.put(beams.n, {{}, direction});
        receiver.receive(at, beams, first, options.motions, std::span(out).subspan(first));
    }
    return out;
}

}  // namespace narpa::test
