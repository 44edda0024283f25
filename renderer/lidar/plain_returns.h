/// renderer/lidar/plain_returns.h - what Lambert's and Phong's surfaces send back along the rays that meet them,
/// sixteen side by side.
#pragma once

#include <cstdint>

#include "renderer/geometry/tracer.h"

namespace narpa {

/// As LidarReturn has them.
struct alignas(64) PlainReturns {
    std::uint32_t lanes = 0;  ///< those that are set
    Lanes<float> reflectivity, cos_incidence;
};

/// Of those lanes of `met` whose surface is of Lambert or Phong and has no texture but of its colour.
void find_plain_returns(const Tracer& tracer, const RayBatch& rays, const HitBatch& hits, std::uint32_t met,
                        PlainReturns& out) noexcept;

}  // namespace narpa
