// What an observer on the ground sees where, against ERFA's own chain; orbits; the range law through the air.
#include <erfa.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/constants.h"
#include "renderer/ephemeris/observer.h"
#include "renderer/light/atmosphere.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/integrator/path_support.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

using namespace narpa::test;

constexpr std::int64_t kMorning_ns = 1'772'349'600'000'000'000;  // 2026-03-01T07:20:00Z
constexpr double kSkyArcsec = 3600 * kDegPerRad;
const ObserverPlace kGreenwich{
    .latitude_rad = 51.4778 * kRadPerDeg, .longitude_rad = -0.0014 * kRadPerDeg, .height_m = 47};

/// ERFA's observed azimuth and zenith distance of a direction in GCRS.
Vec3 observed_by_erfa(const ObserverPlace& p, const Vec3& gcrs, const GroundObserver& axes, bool refracted) {
    double utc1 = 2440587.5, utc2 = static_cast<double>(kMorning_ns) / 86400e9, tai1, tai2, tt1, tt2;
    eraUtctai(utc1, utc2, &tai1, &tai2);
    eraTaitt(tai1, tai2, &tt1, &tt2);
    double bpn[3][3], x, y, c2i[3][3], v[3] = {gcrs.x, gcrs.y, gcrs.z}, cirs[3], ri, di;
    eraPnm06a(tt1, tt2, bpn);
    eraBpn2xy(bpn, &x, &y);
    eraC2ixys(x, y, eraS06(tt1, tt2, x, y), c2i);
    eraRxp(c2i, v, cirs);
    eraC2s(cirs, &ri, &di);
    double azimuth, zenith, hour, declination, ascension;
    eraAtio13(ri, di, utc1, utc2, p.ut1_utc_s, p.longitude_rad, p.latitude_rad, p.height_m, 0, 0,
              refracted ? p.pressure_hpa : 0, p.temperature_k - 273.15, 0, 0.55, &azimuth, &zenith, &hour,
              &declination, &ascension);
    return std::cos(zenith) * axes.zenith() +
           std::sin(zenith) * (std::cos(azimuth) * axes.north() + std::sin(azimuth) * axes.east());
}

double angle(const Vec3& a, const Vec3& b) {
    return std::atan2(norm(cross(a, b)), dot(a, b));
}

TEST(GroundObserver, SeesAStationWithinAnArcsecondOfErfa) {
    const GroundObserver observer(kGreenwich, kMorning_ns);
    for (double zenith = 0; zenith <= 70; zenith += 10)
        for (double azimuth = 5; azimuth < 360; azimuth += 60) {
            const double z = zenith * kRadPerDeg, a = azimuth * kRadPerDeg;
            const Vec3 geometric = std::cos(z) * observer.zenith() +
                                   std::sin(z) * (std::cos(a) * observer.north() + std::sin(a) * observer.east());
            const Vec3 station = observer.position_m() + 8e5 * geometric;
            // At rest, so that light time does nothing; ERFA knows no parallax of refraction, so without.
            const Vec3 ours = observer.apparent_direction(station, {}, false);
            EXPECT_LT(angle(ours, observed_by_erfa(kGreenwich, geometric, observer, false)) * kSkyArcsec, 0.05);
            const Vec3 raised = observer.refracted(ours, kInfinity);
            EXPECT_LT(angle(raised, observed_by_erfa(kGreenwich, geometric, observer, true)) * kSkyArcsec, 1.0)
                << zenith << " " << azimuth;
            // The parallax of refraction is below 20 arcsec at 800 km and 70 degrees, and raises less.
            const Vec3 near = observer.apparent_direction(station, {}, true);
            EXPECT_LT(angle(near, raised) * kSkyArcsec, 20);
        }
}

TEST(GroundObserver, SeesTheSunWhereErfaDoes) {
    const GroundObserver observer({.latitude_rad = 0.2, .longitude_rad = 0.6}, kMorning_ns);
    // ERFA: the astrometric Sun as a star at infinity, through annual and diurnal aberration, and refraction.
    double utc1 = 2440587.5, utc2 = static_cast<double>(kMorning_ns) / 86400e9, tai1, tai2, tt1, tt2;
    eraUtctai(utc1, utc2, &tai1, &tai2);
    eraTaitt(tai1, tai2, &tt1, &tt2);
    double heliocentric[2][3], barycentric[2][3];
    eraEpv00(tt1, tt2, heliocentric, barycentric);
    const Vec3 topocentric = -149'597'870'700.0 * Vec3{heliocentric[0][0], heliocentric[0][1], heliocentric[0][2]} -
                             observer.position_m();
    double v[3] = {topocentric.x, topocentric.y, topocentric.z}, ra, dec, az, zd, ha, d, r, eo;
    eraC2s(v, &ra, &dec);
    // No star stands in the Sun: eraAtco13 limits the deflection of its light there to below 1 arcsec.
    eraAtco13(ra, dec, 0, 0, 0, 0, utc1, utc2, 0, 0.6, 0.2, 0, 0, 0, 1010, 10, 0, 0.55, &az, &zd, &ha, &d, &r, &eo);
    const Vec3 expected = std::cos(zd) * observer.zenith() +
                          std::sin(zd) * (std::cos(az) * observer.north() + std::sin(az) * observer.east());
    ASSERT_LT(zd, 75 * kRadPerDeg);
    EXPECT_LT(angle(observer.apparent_sun(), expected) * kSkyArcsec, 1.0);
}

TEST(Orbit, KeepsItsEnergyAndPeriod) {
    for (const double e : {0.0, 0.1, 0.7}) {
        const OrbitalElements o{
            .semi_major_axis_m = 2e7, .eccentricity = e, .inclination_rad = 0.9, .mean_anomaly_rad = 2};
        const double period = 2 * kPi * std::sqrt(8e21 / 3.986004418e14);
        const OrbitalState start = state_of(o), later = state_of(o, period);
        EXPECT_LT(norm(start.position_m - later.position_m), 1e-3);
        for (double t = 0; t < period; t += period / 7) {
            const OrbitalState s = state_of(o, t);
            const double energy = 0.5 * dot(s.velocity_m_s, s.velocity_m_s) - 3.986004418e14 / norm(s.position_m);
            EXPECT_NEAR(energy, -3.986004418e14 / 4e7, 1e-3);
            const OrbitalState next = state_of(o, t + 1e-3);
            EXPECT_LT(norm((next.position_m - s.position_m) / 1e-3 - s.velocity_m_s), 0.01);
        }
    }
}

constexpr const char* kGroundScene = R"([scene]
epoch = 2026-03-01T07:20:00Z
[sun]
[atmosphere]
body = "earth"
turbidity = 3
[observer]
latitude_deg = 51.4778
longitude_deg = -0.0014
height_m = 47
earth = "earth"
sees = ["station"]
[[body]]
name = "earth"
ellipsoid = {semi_axes_m = [6378137, 6378137, 6356752.3142]}
[[body]]
name = "station"
sphere = {radius_m = 50}
orbit = {semi_major_axis_m = 6791000, inclination_deg = 51.6, ascending_node_deg = 20, mean_anomaly_deg = 80}
[[camera]]
name = "telescope"
resolution = [64, 64]
fov_horizontal_deg = 0.05
track = "station"
)";

TEST(GroundScene, PointsTheTelescopeAtTheApparentStation) {
    const MemoryFolder folder;
    const auto scene = read_scene(folder.write("s.toml", kGroundScene));
    ASSERT_TRUE(scene) << scene.error().text();
    ASSERT_TRUE(scene->atmosphere);
    EXPECT_NEAR(scene->atmosphere->air.ground_radius_m, 6371000, 500);
    const Camera& c = scene->cameras[0];
    const Vec3 line = scene->bodies[1].initial.T_world_body.t - c.T_mount_camera.t;
    EXPECT_LT(angle(c.T_mount_camera.q * Vec3{0, 0, 1}, line) * kSkyArcsec, 0.001);
    const GroundObserver observer(kGreenwich, kMorning_ns);
    EXPECT_LT(norm(c.T_mount_camera.t - observer.position_m()), 1e-3);
    // On the ground of the turned ellipsoid: 47 m above it.
    const Vec3 p = conjugate(scene->bodies[0].initial.T_world_body.q) * c.T_mount_camera.t;
    const Vec3 k{p.x / 6378137, p.y / 6378137, p.z / 6356752.3142};
    EXPECT_NEAR((norm(k) - 1) * 6.37e6, 47, 0.5);
}

TEST(GroundScene, TheFirstSecondOf1970IsATimeLikeAnyOther) {
    const MemoryFolder folder;
    for (const char* epoch : {"1970-01-01T00:00:00Z", "1970-01-01T01:00:00+01:00", "1969-12-31T23:59:59Z"}) {
        std::string text = kGroundScene;
        text.replace(text.find("2026-03-01T07:20:00Z"), 20, epoch);
        const auto scene = read_scene(folder.write("s.toml", text));
        ASSERT_TRUE(scene) << epoch << ": " << scene.error().text();
        const GroundObserver observer(kGreenwich, scene->epoch_unix_ns);
        EXPECT_LT(norm(scene->cameras[0].T_mount_camera.t - observer.position_m()), 1e-3) << epoch;
    }
}

TEST(GroundScene, AnObserverOnTheEllipsoidIsAboveItsSurface) {
    const MemoryFolder folder;
    for (const double latitude_deg : {0.0, 12.3, 45.0, -67.8, 90.0}) {
        std::string text = kGroundScene;
        text.replace(text.find("51.4778"), 7, fmt::format("{}", latitude_deg));
        text.replace(text.find("height_m = 47"), 13, "");
        const auto scene = read_scene(folder.write("s.toml", text));
        ASSERT_TRUE(scene) << scene.error().text();
        const auto tracer = Tracer::create(*scene, 1);
        ASSERT_TRUE(tracer);
        const Vec3 from = scene->cameras[0].T_mount_camera.t;
        const Hit up = tracer->intersect(placed(*scene), {from, normalized(from)}, kInfinity);
        EXPECT_NE(up.body, 0) << latitude_deg;
    }
    std::string text = kGroundScene;
    text.replace(text.find("height_m = 47"), 13, "height_m = -5");
    const auto below = read_scene(folder.write("s.toml", text));
    ASSERT_FALSE(below);
    EXPECT_NE(below.error().what.find("below the surface of `earth`"), std::string::npos);
}

/// The scene at a later time is the one of a later epoch: the orbit, the Earth, the telescope.
TEST(GroundScene, AtALaterTimeIsTheOneOfALaterEpoch) {
    const MemoryFolder folder;
    const auto now = read_scene(folder.write("now.toml", kGroundScene));
    ASSERT_TRUE(now) << now.error().text();
    const double degrees_per_s = std::sqrt(3.986004418e14 / 6791e3) / 6791e3 * kDegPerRad;
    for (const int t : {1, 30, 50}) {
        std::string text = kGroundScene;
        text.replace(text.find("07:20:00Z"), 9, fmt::format("07:20:{:02}Z", t));
        text.replace(text.find("= 80}"), 5, fmt::format("= {:.12f}}}", 80 + degrees_per_s * t));
        const auto later = read_scene(folder.write(fmt::format("{}.toml", t), text));
        ASSERT_TRUE(later) << later.error().text();
        EXPECT_LT(norm(motion_at(now->bodies[1], t).T_world_body.t - later->bodies[1].initial.T_world_body.t),
                  1e-3);
        EXPECT_LT(norm(motion_at(now->bodies[1], t).velocity_m_s - later->bodies[1].initial.velocity_m_s), 1e-5);
        EXPECT_LT(
            angle_between(motion_at(now->bodies[0], t).T_world_body.q, later->bodies[0].initial.T_world_body.q),
            1e-8);
        const Rigid3 telescope = now->cameras[0].course->at(t).T_world_body,
                     expected = later->cameras[0].T_mount_camera;
        EXPECT_LT(norm(telescope.t - expected.t), 1e-3);
        EXPECT_LT(angle_between(telescope.q, expected.q), 1e-8);
    }
}

TEST(GroundScene, CoursesHaveTheDerivativesOfTheirPoses) {
    const MemoryFolder folder;
    const auto scene = read_scene(folder.write("s.toml", kGroundScene));
    ASSERT_TRUE(scene) << scene.error().text();
    for (const auto& course : {scene->bodies[1].course, scene->cameras[0].course}) {
        constexpr double kT = 20, kStep = 0.01;
        const Motion before = course->at(kT - kStep), at = course->at(kT), after = course->at(kT + kStep);
        const Vec3 velocity = (after.T_world_body.t - before.T_world_body.t) / (2 * kStep);
        EXPECT_LT(norm(at.velocity_m_s - velocity), 1e-4);
        const Vec3 rate = rotation_vector(conjugate(before.T_world_body.q) * after.T_world_body.q) / (2 * kStep);
        EXPECT_LT(norm(at.rate_rad_s - rate), 1e-7);
    }
    EXPECT_NEAR(norm(scene->bodies[1].course->at(0).velocity_m_s), std::sqrt(3.986004418e14 / 6791e3), 20);
}

TEST(GroundScene, ATelescopeAtAzimuthAndElevationTurnsWithTheEarth) {
    std::string text = kGroundScene;
    text.replace(text.find("track = \"station\""), 17, "azimuth_elevation_deg = [150.0, 40.0]");
    const MemoryFolder folder;
    const auto scene = read_scene(folder.write("s.toml", text));
    ASSERT_TRUE(scene) << scene.error().text();
    const Rigid3 T = scene->cameras[0].course->at(3600).T_world_body;
    const GroundObserver observer(kGreenwich, kMorning_ns + 3'600'000'000'000);
    EXPECT_LT(norm(T.t - observer.position_m()), 1e-3);
    const Vec3 forward = T.q * Vec3{0, 0, 1};
    EXPECT_NEAR(dot(forward, observer.zenith()), std::sin(40 * kRadPerDeg), 1e-9);
    EXPECT_NEAR(std::atan2(dot(forward, observer.east()), dot(forward, observer.north())), 150 * kRadPerDeg, 1e-9);
    EXPECT_LT(std::abs(dot(T.q * Vec3{1, 0, 0}, observer.zenith())), 1e-9);
}

TEST(GroundScene, FollowingAllocatesNothing) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "the sanitizer's heap counts nothing";
    const MemoryFolder folder;
    const auto scene = read_scene(folder.write("s.toml", kGroundScene));
    ASSERT_TRUE(scene) << scene.error().text();
    const AllocationCounter count;
    const Motion station = scene->bodies[1].course->at(10), telescope = scene->cameras[0].course->at(10);
    EXPECT_EQ(count.on_this_thread(), 0u);
    EXPECT_GT(norm(station.T_world_body.t - telescope.T_world_body.t), 4e5);
}

/// Rays of an image are straight, and bodies stand where they are seen: a station 45 degrees above the horizon
/// falls into the pixel to which ERFA refracts it, 20 pixels from where it would fall without air.
TEST(GroundScene, AStationFallsIntoThePixelOfItsApparentPlace) {
    const GroundObserver observer(kGreenwich, kMorning_ns);
    const double z = 45 * kRadPerDeg, a = 150 * kRadPerDeg;
    const Vec3 geometric = std::cos(z) * observer.zenith() +
                           std::sin(z) * (std::cos(a) * observer.north() + std::sin(a) * observer.east());
    const Vec3 station = observer.position_m() + 1e7 * geometric;  // so far that refraction has no parallax
    std::string text = kGroundScene;
    const auto replace = [&](std::string_view key, const std::string& with) {
        const std::size_t at = text.find(key);
        ASSERT_NE(at, std::string::npos);
        text.replace(at, text.find('\n', at) - at, with);
    };
    replace("orbit =", fmt::format("position_m = [{:.3f}, {:.3f}, {:.3f}]", station.x, station.y, station.z));
    replace("sphere = {", "sphere = {radius_m = 100}");
    replace("track =", "azimuth_elevation_deg = [150.0, 45.01]");
    const MemoryFolder folder;
    const auto scene = read_scene(folder.write("s.toml", text));
    ASSERT_TRUE(scene) << scene.error().text();
    const auto render_scene = RenderScene::create(*scene, 2);
    ASSERT_TRUE(render_scene);
    const Camera& c = scene->cameras[0];
    const double focal_px = 32 / std::tan(0.025 * kRadPerDeg);
    const auto pixel_of = [&](const Vec3& direction) {
        const Vec3 d = conjugate(c.T_mount_camera.q) * direction;
        return Vec3{31.5 + focal_px * d.x / d.z, 31.5 + focal_px * d.y / d.z, 0};
    };
    const Vec3 expected = pixel_of(observed_by_erfa(kGreenwich, geometric, observer, true)),
               unrefracted = pixel_of(observed_by_erfa(kGreenwich, geometric, observer, false));
    EXPECT_GT(norm(expected - unrefracted), 15);
    Vec3 sum{};
    int met = 0;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) {
            const Vec3 d = normalized(Vec3{(x - 31.5) / focal_px, (y - 31.5) / focal_px, 1});
            const Hit hit = render_scene->tracer().intersect(
                placed(*scene), {c.T_mount_camera.t, c.T_mount_camera.q * d, 0}, kInfinity);
            if (hit.body != 1) continue;
            sum += Vec3{static_cast<double>(x), static_cast<double>(y), 0};
            ++met;
        }
    ASSERT_GT(met, 0);
    EXPECT_LT(norm(sum / met - expected), 0.7);
}

TEST(GroundScene, AStationDimsByTheRangeLawThroughTheAir) {
    // A white sphere overhead, at 400 km and at 1200 km: radiance less the sky's stays, so its light falls as 1 /
    // r^2.
    Scene s;
    s.materials.push_back(lambert(0.3f));
    s.materials.push_back(lambert(0.8f));
    add_sphere(s, 6'371'000, {});
    s.sun = Sun{};
    s.atmosphere.emplace();
    add_sphere(s, 50, {0, 0, 6'771'000});
    std::get<ExactShape>(s.bodies.back().shape).material = 1;
    s.sun->direction = normalized(Vec3{1, 0, 0.3});
    const Vec3 eye{0, 0, 6'371'002};
    const auto through_air = RenderScene::create(s, 2);
    Scene airless = s;
    airless.atmosphere.reset();
    const auto in_vacuum = RenderScene::create(airless, 2);
    ASSERT_TRUE(through_air && in_vacuum);
    const auto seen = [&](double height, bool air) {
        Scene moved = s;
        moved.bodies.back().initial.T_world_body.t.z = 6'371'000 + height;
        const auto light = [&](double aside_m) {
            return light_along(air ? *through_air : *in_vacuum, placed(moved),
                               {eye, normalized(Vec3{aside_m / height, 0, 1})}, {.max_depth = 1, .direct = true}, 1)
                .mean.y;
        };
        return light(40) - light(60);  // the sphere less the sky beside it
    };
    const double near = seen(400e3, true), far = seen(1200e3, true), vacuum = seen(400e3, false);
    EXPECT_NEAR(far / near, 1, 2e-3);
    const Air air(earth_air(), 8);
    const Rgb through = transmittance_of(air, columns_along(air, PanelRule(32), eye, {0, 0, 1}, kInfinity));
    EXPECT_NEAR(near / vacuum, static_cast<double>(through.y), 3e-3);
}

}  // namespace
}  // namespace narpa
