// Air along the rays of a tile, from fewer integrals: near to the integral along each ray.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/constants.h"
#include "renderer/atmosphere/ray_bundle.h"

namespace narpa::test {
namespace {

constexpr double kSunRadius_rad = 0.00465;
constexpr int kSide = 8;
using Rays = std::vector<RayBundle::Ray>;

const ScatteredLight& hazy_earth() {
    static const ScatteredLight light(Air(earth_air(3), 2), {.heights = 12, .suns = 24}, kSunRadius_rad);
    return light;
}
double radius_m() {
    return hazy_earth().air().ground_radius_m();
}

Vec3 direction_at(double elevation_deg, double azimuth_deg) {
    const double e = elevation_deg * kRadPerDeg, a = azimuth_deg * kRadPerDeg;
    return {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
}
/// The pixels of a tile, each 0.1 degrees wide.
template <class RangeOf>
Rays tile(double elevation_deg, double azimuth_deg, RangeOf&& range_of) {
    Rays rays;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            const Vec3 d = direction_at(elevation_deg + 0.1 * y, azimuth_deg + 0.1 * x);
            rays.push_back({d, range_of(d, x, y)});
        }
    return rays;
}
constexpr auto kToSpace = [](const Vec3&, int, int) { return kInfinity; };
/// Down to a height above the ground, along a ray from a height on the z axis.
auto down_to(double from_m, auto&& height_of) {
    return [=](const Vec3& d, int x, int y) {
        const double z = radius_m() + from_m, r = radius_m() + height_of(x, y), along = z * d.z;
        return -along - std::sqrt(along * along - z * z + r * r);
    };
}

struct Comparison {
    double most = 0;  ///< relative difference of a band
    std::size_t integrals = 0;
};
Comparison compare(double height_m, const Rays& rays, const Vec3& to_sun) {
    const Vec3 origin{0, 0, radius_m() + height_m};
    std::vector<AirLight> found(rays.size());
    RayBundle bundle(hazy_earth(), origin, &to_sun);
    bundle.trace(rays, found);
    Comparison c{.integrals = bundle.integrals()};
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const AirLight exact = air_along(hazy_earth(), origin, rays[i].direction, rays[i].range_m, &to_sun);
        for (int band = 0; band < 3; ++band) {
            const auto off = [&](const Rgb& a, const Rgb& b, double floor) {
                c.most = std::max(c.most, static_cast<double>(std::abs(a[band] - b[band])) /
                                              (static_cast<double>(std::abs(b[band])) + floor));
            };
            off(found[i].in_scattering, exact.in_scattering, 1e-7);
            off(found[i].transmittance, exact.transmittance, 1e-3);
        }
    }
    return c;
}

TEST(RayBundle, OfTheSkyTakesFiveIntegrals) {
    for (const double sun : {60.0, 20.0, 5.0, -3.0})
        for (const double elevation : {10.0, 30.0, 80.0}) {
            const Comparison c = compare(2, tile(elevation, 40, kToSpace), direction_at(sun, 0));
            EXPECT_LE(c.most, RayBundle::kTolerance) << sun << " " << elevation;
            EXPECT_EQ(c.integrals, 5U) << sun << " " << elevation;
        }
}

TEST(RayBundle, IsDividedAtTheHorizonAndAtTheLimb) {
    for (const double sun : {60.0, 5.0, -3.0}) {
        const Comparison horizon = compare(2, tile(-0.3, 40, kToSpace), direction_at(sun, 0));
        EXPECT_LE(horizon.most, RayBundle::kTolerance);
        // From 400 km the ground's limb is 19.8 degrees down, and the air's top 17.
        const Comparison limb = compare(400'000, tile(-19.9, 40, kToSpace), direction_at(sun, 0));
        EXPECT_LE(limb.most, RayBundle::kTolerance);
        EXPECT_GT(limb.integrals, 5U);
    }
}

TEST(RayBundle, OfTheGroundFromOrbitTakesFiveIntegrals) {
    for (const double elevation : {-30.0, -60.0, -90.2}) {
        const Comparison c = compare(400'000, tile(elevation, 40, down_to(400'000, [](int, int) { return 0.0; })),
                                     direction_at(30, 0));
        EXPECT_LE(c.most, RayBundle::kTolerance) << elevation;
        EXPECT_EQ(c.integrals, 5U) << elevation;
    }
}

TEST(RayBundle, OfMountainsTakesNineIntegrals) {
    const auto heights = [](int x, int y) { return 2000 + 100 * std::sin(1.7 * x) * std::cos(2.3 * y); };
    const Comparison c = compare(400'000, tile(-60, 40, down_to(400'000, heights)), direction_at(30, 0));
    EXPECT_LE(c.most, RayBundle::kTolerance);
    EXPECT_EQ(c.integrals, 9U);
}

TEST(RayBundle, RaysThatEndElsewhereAreIntegrated) {
    const Rays rays = tile(10, 40, [](const Vec3&, int x, int) { return 1000.0 + 100 * x; });
    const Comparison c = compare(2, rays, direction_at(30, 0));
    EXPECT_EQ(c.most, 0);
    EXPECT_EQ(c.integrals, rays.size());
}

TEST(RayBundle, BeyondTheAirIsASpaceLikeAnyOther) {
    // A station above the air, half of the tile, before empty sky.
    const Rays rays = tile(40, 40, [](const Vec3&, int x, int) { return x < kSide / 2 ? 6e5 : kInfinity; });
    const Comparison c = compare(2, rays, direction_at(30, 0));
    EXPECT_LE(c.most, RayBundle::kTolerance);
    EXPECT_EQ(c.integrals, 5U);
}

TEST(RayBundle, WithoutASunItDimsAlone) {
    const Rays rays = tile(10, 40, kToSpace);
    std::vector<AirLight> found(rays.size());
    const Vec3 origin{0, 0, radius_m() + 2};
    RayBundle(hazy_earth(), origin, nullptr).trace(rays, found);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const AirLight exact = air_along(hazy_earth(), origin, rays[i].direction, kInfinity, nullptr);
        EXPECT_EQ(found[i].in_scattering, Rgb{});
        EXPECT_NEAR(found[i].transmittance.x, exact.transmittance.x, 1e-3F);
        EXPECT_LT(found[i].transmittance.z, 0.7F);
    }
}

}  // namespace
}  // namespace narpa::test
