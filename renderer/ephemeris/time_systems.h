/// renderer/ephemeris/time_systems.h - calendar times of flight dynamics' files, in one uniform scale.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <utility>

#include "base/pose.h"
#include "base/result.h"

namespace narpa {

enum class TimeSystem : std::uint8_t { utc, tai, tt, tdb, gps };
inline constexpr std::array<std::pair<std::string_view, TimeSystem>, 5> kTimeSystems{{{"UTC", TimeSystem::utc},
                                                                                      {"TAI", TimeSystem::tai},
                                                                                      {"TT", TimeSystem::tt},
                                                                                      {"TDB", TimeSystem::tdb},
                                                                                      {"GPS", TimeSystem::gps}}};

/// TAI in ns since 2000-01-01 00:00:00 TAI, of a text YYYY-MM-DDThh:mm:ss[.d][Z] or YYYY-DDDThh:mm:ss[.d][Z]
/// (CCSDS 301.0-B, ASCII time codes A and B), years 1972 to 2099. UTC may have a leap second, 23:59:60. TDB is
/// exact to 10 us, GPS is TAI - 19 s. The Error has neither file nor line.
Result<std::int64_t> tai_ns(std::string_view text, TimeSystem system);
/// The same of UTC in ns since 1970, without leap seconds. Before 1972 as if leap seconds had begun with 10 s.
[[nodiscard]] std::int64_t tai_ns_of_utc(std::int64_t unix_ns);

/// The mean equator and equinox of J2000 (EME2000) in the axes of GCRS and ICRS: IAU 2006 frame bias, 0.1 urad.
[[nodiscard]] Quat q_icrf_eme2000();

}  // namespace narpa
