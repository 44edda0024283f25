#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "base/constants.h"
#include "renderer/ephemeris/sun_direction.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

std::int64_t utc_ns(int year, unsigned month, unsigned day, int hour, int minute) {
    using namespace std::chrono;
    const auto t =
        sys_days(std::chrono::year(year) / month / std::chrono::day(day)) + hours(hour) + minutes(minute);
    return duration_cast<nanoseconds>(t.time_since_epoch()).count();
}

/// From the vernal equinox along the ecliptic of J2000.
Vec3 at_ecliptic_longitude(double degrees) {
    const double l = degrees * kRadPerDeg, obliquity = 23.4392911 * kRadPerDeg;
    return {std::cos(l), std::sin(l) * std::cos(obliquity), std::sin(l) * std::sin(obliquity)};
}

double angle_deg(const Vec3& a, const Vec3& b) {
    return std::atan2(norm(cross(a, b)), dot(a, b)) / kRadPerDeg;
}

// Equinoxes and solstices of 2000 to the minute (US Naval Observatory, Earth's Seasons). Apparent longitude of date
// against geometric J2000 GCRS: aberration 0.0057 deg, precession and nutation up to 0.014 deg, a minute 0.0007
// deg.
TEST(SunDirection, StandsAtTheSeasonsOf2000) {
    EXPECT_LT(angle_deg(sun_direction_gcrs(utc_ns(2000, 3, 20, 7, 35)), at_ecliptic_longitude(0)), 0.025);
    EXPECT_LT(angle_deg(sun_direction_gcrs(utc_ns(2000, 6, 21, 1, 48)), at_ecliptic_longitude(90)), 0.025);
    EXPECT_LT(angle_deg(sun_direction_gcrs(utc_ns(2000, 9, 22, 17, 27)), at_ecliptic_longitude(180)), 0.025);
    EXPECT_LT(angle_deg(sun_direction_gcrs(utc_ns(2000, 12, 21, 13, 37)), at_ecliptic_longitude(270)), 0.025);
}

// Meeus, Astronomical Algorithms, example 25.b: 1992 October 13.0 TD, true geometric longitude 199.907372 deg of
// the mean equinox of date, latitude 0.000179 deg; the equinox had moved by 50.29" a year since J2000.
TEST(SunDirection, AgreesWithMeeusExample25b) {
    const double years = -7.2156, j2000_longitude = 199.907372 - years * 50.29 / 3600;
    const std::int64_t t = utc_ns(1992, 10, 12, 23, 59) + 1'000'000'000;  // TD - UTC was 59 s
    EXPECT_LT(angle_deg(sun_direction_gcrs(t), at_ecliptic_longitude(j2000_longitude)), 0.0015);
}

TEST(SunDirection, IsUnitAndSmoothFarFromNow) {
    for (const int year : {1900, 1955, 1969, 1970, 2035, 2099}) {
        const std::int64_t t = utc_ns(year, 7, 1, 0, 0), day = 86'400'000'000'000;
        EXPECT_NEAR(norm(sun_direction_gcrs(t)), 1, 1e-15);
        EXPECT_NEAR(angle_deg(sun_direction_gcrs(t), sun_direction_gcrs(t + day)), 0.9533, 0.003)
            << year;  // at aphelion
    }
}

TEST(SunDirection, SceneTakesItFromTheEpoch) {
    const test::MemoryFolder folder;
    const Result<Scene> s =
        read_scene(folder.write("s.toml",
                                "[scene]\nepoch = 2000-06-21T01:48:00Z\n[sun]\n[[body]]\nname = \"b\"\n"
                                "sphere = {radius_m = 1}\n[[lidar]]\nname = \"l\"\nmodel = \"VLP-16\"\n"));
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->sun->direction, sun_direction_gcrs(utc_ns(2000, 6, 21, 1, 48)));
}

}  // namespace
}  // namespace narpa
