// Air along the rays of a tile, from fewer integrals: near to the integral along each ray.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <thread>
#include <vector>

#include "base/constants.h"
#include "renderer/atmosphere/refraction/ray_bundle.h"

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

/// Against the integral along each ray. Nodes agree to kTolerance with values between them; what lies elsewhere in
/// a cell may be somewhat farther off.
constexpr double kMaxOff = 2 * static_cast<double>(RayBundle::kTolerance);
struct Comparison {
    double most = 0;  ///< relative difference of a band
    std::size_t integrals = 0;
};
Comparison compare(double height_m, const Rays& rays, const Vec3& to_sun, AirCache& cells) {
    const Vec3 origin{0, 0, radius_m() + height_m};
    std::vector<AirLight> found(rays.size());
    RayBundle bundle(hazy_earth(), origin, &to_sun, cells);
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
            off(found[i].transmittance, exact.transmittance, 1e-2);
        }
    }
    return c;
}
Comparison compare(double height_m, const Rays& rays, const Vec3& to_sun) {
    AirCache cells;
    return compare(height_m, rays, to_sun, cells);
}

TEST(RayBundle, OfTheSkyTakesACellOrAFew) {
    for (const double sun : {60.0, 20.0, 5.0, -3.0})
        for (const double elevation : {10.0, 30.0, 80.0}) {
            const Comparison c = compare(2, tile(elevation, 40, kToSpace), direction_at(sun, 0));
            EXPECT_LE(c.most, kMaxOff) << sun << " " << elevation;
            EXPECT_LE(c.integrals, 64U) << sun << " " << elevation;
        }
}

TEST(RayBundle, NeighboursShareCells) {
    AirCache cells;
    std::size_t integrals = 0;
    for (int x = 0; x < 20; ++x) {
        const Comparison c =
            compare(2, tile(5 + 0.8 * (x % 4), 30 + 0.8 * (x / 4), kToSpace), direction_at(30, 0), cells);
        EXPECT_LE(c.most, kMaxOff);
        integrals += c.integrals;
    }
    EXPECT_LE(integrals, 20U * 8U);
    EXPECT_EQ(compare(2, tile(5, 30, kToSpace), direction_at(30, 0), cells).integrals, 0U);
    // Another place, another Sun: other cells.
    EXPECT_GT(compare(3, tile(5, 30, kToSpace), direction_at(30, 0), cells).integrals, 0U);
    EXPECT_GT(compare(2, tile(5, 30, kToSpace), direction_at(31, 0), cells).integrals, 0U);
}

TEST(RayBundle, WhatIsFoundChangesNothing) {
    const Vec3 origin{0, 0, radius_m() + 2}, to_sun = direction_at(5, 0);
    const Rays rays = tile(-0.3, 40, kToSpace);
    std::vector<AirLight> alone(rays.size()), among_others(rays.size());
    AirCache fresh, used;
    RayBundle(hazy_earth(), origin, &to_sun, fresh).trace(rays, alone);
    for (int x = 0; x < 40; ++x)
        (void)compare(2, tile(-1 + 0.2 * (x % 8), 30 + 0.7 * (x / 8), kToSpace), to_sun, used);
    RayBundle(hazy_earth(), origin, &to_sun, used).trace(rays, among_others);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        EXPECT_EQ(alone[i].in_scattering, among_others[i].in_scattering);
        EXPECT_EQ(alone[i].transmittance, among_others[i].transmittance);
    }
}

TEST(RayBundle, IsDividedAtTheHorizonAndAtTheLimb) {
    for (const double sun : {60.0, 5.0, -3.0}) {
        const Comparison horizon = compare(2, tile(-0.3, 40, kToSpace), direction_at(sun, 0));
        EXPECT_LE(horizon.most, kMaxOff);
        // From 400 km the ground's limb is 19.8 degrees down, and the air's top 17.
        const Comparison limb = compare(400'000, tile(-19.9, 40, kToSpace), direction_at(sun, 0));
        EXPECT_LE(limb.most, kMaxOff);
        EXPECT_GT(limb.integrals, 13U);
    }
}

TEST(RayBundle, OfTheGroundFromOrbitTakesACellOrTwo) {
    for (const double elevation : {-30.0, -60.0, -90.2}) {
        const Comparison c = compare(400'000, tile(elevation, 40, down_to(400'000, [](int, int) { return 0.0; })),
                                     direction_at(30, 0));
        EXPECT_LE(c.most, kMaxOff) << elevation;
        EXPECT_LE(c.integrals, 26U) << elevation;
    }
}

TEST(RayBundle, OfTheGroundUnderfootReachesToTheHorizon) {
    AirCache cells;
    std::size_t integrals = 0;
    for (int x = 0; x < 40; ++x) {
        const double down = -1.3 - 0.8 * (x / 8);
        const Comparison c =
            compare(100, tile(down, 20 + 0.8 * (x % 8), down_to(100, [](int, int) { return 0.0; })),
                    direction_at(30, 0), cells);
        EXPECT_LE(c.most, kMaxOff) << down;
        integrals += c.integrals;
    }
    EXPECT_LE(integrals, 40U * 13U);
}

TEST(RayBundle, OfMountainsTakesCellsBetweenLayers) {
    const auto heights = [](int x, int y) { return 2000 + 100 * std::sin(1.7 * x) * std::cos(2.3 * y); };
    AirCache cells;
    std::size_t integrals = 0;
    for (int x = 0; x < 40; ++x) {
        const Comparison c =
            compare(400'000, tile(-60 + 0.8 * (x % 8), 40 + 0.8 * (x / 8), down_to(400'000, heights)),
                    direction_at(30, 0), cells);
        EXPECT_LE(c.most, kMaxOff);
        integrals += c.integrals;
    }
    EXPECT_LE(integrals, 40U * 13U);
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
    EXPECT_LE(c.most, kMaxOff);
    EXPECT_LE(c.integrals, 26U);
}

TEST(RayBundle, WithoutASunItDimsAlone) {
    const Rays rays = tile(10, 40, kToSpace);
    std::vector<AirLight> found(rays.size());
    const Vec3 origin{0, 0, radius_m() + 2};
    AirCache cells;
    RayBundle(hazy_earth(), origin, nullptr, cells).trace(rays, found);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const AirLight exact = air_along(hazy_earth(), origin, rays[i].direction, kInfinity, nullptr);
        EXPECT_EQ(found[i].in_scattering, Rgb{});
        EXPECT_NEAR(found[i].transmittance.x, exact.transmittance.x, 1e-3F);
        EXPECT_LT(found[i].transmittance.z, 0.7F);
    }
}

AirCell cell_of(float value, std::uint32_t layers) {
    AirCell cell;
    cell.layers = layers, cell.differs = 0;
    for (std::size_t i = 0; i < layers * AirCell::kLayer; ++i)
        cell.nodes[i] = {{value, value, value}, {value, value, value}};
    return cell;
}

TEST(AirCache, AreFoundByTheirKeyAlone) {
    AirCache cells;
    AirCell found;
    EXPECT_FALSE(cells.find(1, found));
    cells.store(1, cell_of(0.5f, 2));
    EXPECT_FALSE(cells.find(1 + AirCache::kEntries, found));
    ASSERT_TRUE(cells.find(1, found));
    EXPECT_EQ(found.layers, 2U);
    EXPECT_EQ(found.nodes[17].in_scattering.z, 0.5f);
    AirCell divided;
    divided.layers = 1, divided.differs = AirCell::kAlongV;
    cells.store(1 + AirCache::kEntries, divided);
    EXPECT_FALSE(cells.find(1, found));
    ASSERT_TRUE(cells.find(1 + AirCache::kEntries, found));
    EXPECT_EQ(found.differs, AirCell::kAlongV);
}

/// Threads that write one entry at once: what is found is always what one of them wrote.
TEST(AirCache, AreNeverFoundTorn) {
    AirCache cells;
    std::vector<std::thread> threads;
    std::array<std::size_t, 4> found{};
    std::array<bool, 4> torn{};
    for (std::size_t t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            AirCell cell;
            for (std::size_t i = 0; i < 20'000; ++i) {
                const std::uint64_t key = 7 + AirCache::kEntries * ((i + t) % 4);
                cells.store(key, cell_of(static_cast<float>((i + t) % 4), 2));
                const std::uint64_t other = 7 + AirCache::kEntries * (i % 3);
                if (!cells.find(other, cell)) continue;
                ++found[t];
                for (std::size_t k = 0; k < 18; ++k)
                    torn[t] |= cell.nodes[k].transmittance.x != static_cast<float>(i % 3) ||
                               cell.nodes[k].in_scattering.z != static_cast<float>(i % 3);
            }
        });
    for (std::thread& t : threads) t.join();
    EXPECT_GT(std::accumulate(found.begin(), found.end(), std::size_t{0}), 0U);
    EXPECT_EQ(torn, (std::array<bool, 4>{}));
}

}  // namespace
}  // namespace narpa::test
