// How bodies of the solar system stand and turn, against ephemerides and published rates; ICQ shape models.
#include <erfa.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/ephemeris/iau_rotation.h"
#include "renderer/ephemeris/sun_direction.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using test::MemoryFolder;

constexpr std::int64_t kDay_ns = 86'400'000'000'000,
                       kEquinox2026_ns = 1'774'018'560'000'000'000;  // 20 March, 14:56
constexpr double kOneDegree = std::numbers::pi / 180;

TEST(Rotation, TheMoonFacesTheEarthWithinItsLibration) {
    double farthest_lon = 0, farthest_lat = 0;
    for (int day = 0; day < 3650; day += 3) {
        const std::int64_t t = kEquinox2026_ns + day * kDay_ns;
        double pv[2][3];
        eraMoon98(2440587.5 + static_cast<double>(t) / static_cast<double>(kDay_ns), 69.2 / 86400, pv);
        const Vec3 earth = conjugate(*q_icrs_body("moon", t)) * -normalized(Vec3{pv[0][0], pv[0][1], pv[0][2]});
        farthest_lon = std::max(farthest_lon, std::abs(std::atan2(earth.y, earth.x)) / kOneDegree);
        farthest_lat = std::max(farthest_lat, std::abs(std::asin(earth.z)) / kOneDegree);
    }
    EXPECT_LT(farthest_lon, 8.1);  // optical libration: 7.9 and 6.9 degrees
    EXPECT_GT(farthest_lon, 7.0);
    EXPECT_LT(farthest_lat, 7.0);
    EXPECT_GT(farthest_lat, 6.5);
}

TEST(Rotation, TheSunIsOverGreenwichAtNoonAndOverTheEquatorAtEquinox) {
    const Vec3 sun = conjugate(*q_icrs_body("earth", kEquinox2026_ns)) * sun_direction_gcrs(kEquinox2026_ns);
    EXPECT_NEAR(std::asin(sun.z) / kOneDegree, 0, 0.02);
    const double hours = 14 + 56 / 60.0;  // the equation of time is -7.4 minutes
    EXPECT_NEAR(std::atan2(sun.y, sun.x) / kOneDegree, -15 * (hours - 12 - 7.4 / 60), 0.1);
}

TEST(Rotation, RatesAreThePublishedOnes) {
    const auto day_s = [](const char* body) {
        return 2 * std::numbers::pi / norm(body_rotation_of(body, kEquinox2026_ns)->rate_rad_s);
    };
    EXPECT_NEAR(day_s("earth"), 86164.1, 0.01);
    EXPECT_NEAR(day_s("mars"), 88642.66, 0.05);
    EXPECT_NEAR(day_s("moon"), 27.32166 * 86400, 0.001 * 27.3 * 86400);
    EXPECT_NEAR(day_s("jupiter"), 9 * 3600 + 55 * 60 + 29.71, 0.02);
    EXPECT_NEAR(day_s("vesta"), 5.342 * 3600, 5);
    EXPECT_LT(body_rotation_of("venus", kEquinox2026_ns)->rate_rad_s.z, 0);
    EXPECT_FALSE(q_icrs_body("vulcan", 0));
    for (const std::string_view name : kRotatingBodies) EXPECT_TRUE(body_rotation_of(name, 0)) << name;
}

TEST(Rotation, TheRateTakesTheBodyOn) {
    for (const char* body : {"earth", "mars", "moon"}) {
        const BodyRotation now = *body_rotation_of(body, kEquinox2026_ns);
        const Quat later = *q_icrs_body(body, kEquinox2026_ns + 600'000'000'000);
        EXPECT_LT(angle_between(now.q_icrs_body * exp_rotation(600.0 * now.rate_rad_s), later), 1e-7) << body;
    }
}

TEST(Rotation, ThePoleOfMarsIsInCygnus) {
    const Vec3 pole = *q_icrs_body("mars", 946'728'000'000'000'000) * Vec3{0, 0, 1};  // J2000
    EXPECT_NEAR(std::atan2(pole.y, pole.x) / kOneDegree + 360, 317.681, 0.002);
    EXPECT_NEAR(std::asin(pole.z) / kOneDegree, 52.886, 0.002);
}

TEST(Icq, SixGridsAreAClosedBody) {
    const MemoryFolder folder;
    constexpr int kCells = 4;
    std::string text = std::to_string(kCells) + "\n";
    for (int face = 0; face < 6; ++face)
        for (int j = 0; j <= kCells; ++j)
            for (int i = 0; i <= kCells; ++i) {
                const double u = 2.0 * i / kCells - 1, v = 2.0 * j / kCells - 1, s = face < 3 ? 1 : -1;
                const Vec3 p = normalized(face % 3 == 0   ? Vec3{s, u, v}
                                          : face % 3 == 1 ? Vec3{u, s, v}
                                                          : Vec3{u, v, s});
                text += std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) + "\n";
            }
    const auto mesh = read_mesh(folder.write("ball.icq", text), 1000);
    ASSERT_TRUE(mesh) << mesh.error().text();
    EXPECT_EQ(mesh->mesh.faces.size(), 6u * 2 * kCells * kCells);
    EXPECT_EQ(mesh->mesh.positions.size(), 6u * kCells * kCells + 2);  // welded: as of a closed surface
    for (const auto& f : mesh->mesh.faces) {
        const auto& p = mesh->mesh.positions;
        EXPECT_GT(dot(cross(p[f[1]] - p[f[0]], p[f[2]] - p[f[0]]), p[f[0]] + p[f[1]] + p[f[2]]), 0);
    }
    const auto error_of = [&](const std::string& bad) {
        const auto none = read_mesh(folder.write("bad.icq", bad), 1);
        return none ? "" : none.error().text().substr(folder.write("bad.icq", bad).size());
    };
    EXPECT_EQ(error_of("0\n"), ":1:1: expected the number of cells along an edge, 1 to 4096");
    EXPECT_EQ(error_of("1\n1 2 3\n1 x 3\n"), ":3:3: expected x, y and z of a vertex");
    EXPECT_NE(error_of("1\n1 2 3\n").find("1 vertices, expected 6 * 2^2"), std::string::npos);
}

}  // namespace
}  // namespace narpa
