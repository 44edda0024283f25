#include "renderer/ephemeris/sun_direction.h"

#include <erfa.h>

#include "renderer/ephemeris/time_scales.h"

namespace narpa {

Vec3 sun_direction_gcrs(std::int64_t unix_ns) {
    const JulianDate tt = time_scales(unix_ns).tt;
    double heliocentric[2][3], barycentric[2][3];  // of the Earth: position (au), velocity
    eraEpv00(tt.days, tt.fraction, heliocentric, barycentric);
    return normalized(Vec3{-heliocentric[0][0], -heliocentric[0][1], -heliocentric[0][2]});
}

}  // namespace narpa
