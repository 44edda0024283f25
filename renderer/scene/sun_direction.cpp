#include "renderer/scene/sun_direction.h"

#include <erfa.h>

namespace narpa {

Vec3 sun_direction_gcrs(std::int64_t unix_ns) {
    constexpr std::int64_t kDayNs = 86'400'000'000'000;
    constexpr double kUnixEpochJd = 2440587.5;
    std::int64_t days = unix_ns / kDayNs, rest = unix_ns % kDayNs;
    if (rest < 0) --days, rest += kDayNs;
    double tai1 = 0, tai2 = 0, tt1 = 0, tt2 = 0;
    const double day_fraction = static_cast<double>(rest) / static_cast<double>(kDayNs);
    eraUtctai(kUnixEpochJd + static_cast<double>(days), day_fraction, &tai1, &tai2);
    eraTaitt(tai1, tai2, &tt1, &tt2);
    double heliocentric[2][3], barycentric[2][3];   // of the Earth: position (au), velocity
    eraEpv00(tt1, tt2, heliocentric, barycentric);  // TT stands for TDB: within 2 ms
    return normalized(Vec3{-heliocentric[0][0], -heliocentric[0][1], -heliocentric[0][2]});
}

}  // namespace narpa
