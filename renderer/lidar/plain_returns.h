/// renderer/lidar/plain_returns.h - reflectivity of Lambert and Phong surfaces back along the incident rays,
/// sixteen at a time.
#pragma once

#include <cstdint>

#include "renderer/geometry/tracer.h"

namespace narpa {

/// The members of LidarReturn with these names, for sixteen rays.
struct alignas(64) PlainReturns {
    std::uint32_t lanes = 0;  ///< those that are set
    Lanes<float> reflectivity, cos_incidence;
};

/// Evaluates those lanes of `met` whose material is Lambert or Phong and has no texture but that of its colour.
void find_plain_returns(const Tracer& tracer, const RayBatch& rays, const HitBatch& hits, std::uint32_t met,
                        PlainReturns& out) noexcept;

}  // namespace narpa
