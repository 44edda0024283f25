#include "renderer/ephemeris/time_scales.h"

#include <erfa.h>

namespace narpa {

TimeScales time_scales(std::int64_t unix_ns) {
    constexpr std::int64_t kDayNs = 86'400'000'000'000;
    constexpr double kUnixEpochJd = 2440587.5;
    std::int64_t days = unix_ns / kDayNs, rest = unix_ns % kDayNs;
    if (rest < 0) --days, rest += kDayNs;
    TimeScales t;
    t.utc = {kUnixEpochJd + static_cast<double>(days), static_cast<double>(rest) / static_cast<double>(kDayNs)};
    JulianDate tai;
    eraUtctai(t.utc.days, t.utc.fraction, &tai.days, &tai.fraction);
    eraTaitt(tai.days, tai.fraction, &t.tt.days, &t.tt.fraction);
    return t;
}

}  // namespace narpa
