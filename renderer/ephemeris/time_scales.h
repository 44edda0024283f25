/// renderer/ephemeris/time_scales.h - an instant in the time scales of astronomy.
#pragma once

#include <cstdint>

namespace narpa {

/// Julian date in days: the sum of two parts, as ERFA takes it, to resolve nanoseconds.
struct JulianDate {
    double days = 0, fraction = 0;
};
struct TimeScales {
    JulianDate utc, tt;  ///< TT also stands for TDB: within 2 ms

    [[nodiscard]] double days_since_j2000() const { return tt.days - 2451545.0 + tt.fraction; }
};
/// `unix_ns`: since 1970 in UTC, without leap seconds.
[[nodiscard]] TimeScales time_scales(std::int64_t unix_ns);

}  // namespace narpa
