/// renderer/ephemeris/sun_direction.h - where the Sun stands, as seen from the Earth.
#pragma once

#include <cstdint>

#include "base/vec3.h"

namespace narpa {

/// Unit vector from the Earth's centre to the Sun's at a UTC instant, in GCRS axes (those of ICRS). Geometric:
/// neither light time nor aberration (20.5 arcsec) is applied. ERFA's eraEpv00, good to 0.1 arcsec in the years
/// 1900 to 2100.
Vec3 sun_direction_gcrs(std::int64_t unix_ns);

}  // namespace narpa
