// Scattered sunlight: conservation of energy, brute force, closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/constants.h"
#include "renderer/atmosphere/gauss_legendre.h"
#include "renderer/atmosphere/scattering/path_traced_air.h"
#include "renderer/atmosphere/scattering/rayleigh.h"
#include "renderer/atmosphere/scattering/scattered_light.h"

namespace narpa {
namespace {

constexpr double kSunRadius = 0.00465, kGreen_m = 550e-9;

Vec3 direction_in_air(double zenith_deg, double azimuth_deg) {
    const double z = zenith_deg * kRadPerDeg, a = azimuth_deg * kRadPerDeg;
    return {std::sin(z) * std::cos(a), std::sin(z) * std::sin(a), std::cos(z)};
}

double ray_to_ground(const Air& air, double radius, double up) {
    const double b = radius * up, c = (radius - air.ground_radius_m()) * (radius + air.ground_radius_m());
    return b < 0 && b * b > c ? -b - std::sqrt(b * b - c) : kInfinity;
}

/// Sunlight on a planet: what leaves it, and what ground and air absorb, as parts of what falls onto it.
struct Balance {
    double passes = 0, scattered = 0, ground = 0, air = 0;
    [[nodiscard]] double sum() const { return passes + scattered + ground + air; }
};
Balance balance(const ScatteredLight& light) {
    const Air& air = light.air();
    const double R = air.ground_radius_m(), top = air.top_radius_m(), albedo = air.description().ground_albedo;
    const double falls = kPi * top * top;
    const PanelRule march(32);
    const auto scaled = [&](const AirColumns& c) {
        return std::exp(-static_cast<double>(air.gas[0] * c.gas + air.scaled_extinction[0] * c.aerosol +
                                             air.ozone[0] * c.ozone));
    };
    Balance b;
    const Quadrature fine = gauss_legendre(32), coarse = gauss_legendre(10);
    for (std::size_t i = 0; i < fine.node.size(); ++i) {  // past the limb: between ground and top
        const double p = R + (top - R) * fine.node[i];
        const AirColumns c = columns_along(air, march, {-2 * top, p, 0}, {1, 0, 0}, kInfinity);
        b.passes += fine.weight[i] * (top - R) * 2 * kPi * p * scaled(c) / falls;
    }
    for (int side = 0; side < 2; ++side)  // day and night
        for (std::size_t i = 0; i < fine.node.size(); ++i) {
            const double y = fine.node[i], sun = side == 0 ? y * y : -0.4 * y * y;
            const double weight = fine.weight[i] * 2 * y * (side == 0 ? 1 : 0.4) * 2 * kPi;
            const auto diffuse = static_cast<double>(light.ground_irradiance(sun)[0]);
            const double direct = static_cast<double>(light.sunlight(0, sun, true)[0]) * std::max(0.0, sun);
            b.ground += weight * R * R * (1 - albedo) * (diffuse + direct) / falls;
            for (std::size_t k = 0; k < fine.node.size(); ++k) {
                const double x = fine.node[k], h = (top - R) * x * x, r = R + h;
                const AirDensities at = air.densities(h);
                const double absorbs = static_cast<double>(
                    (air.aerosol_extinction[0] - air.aerosol[0]) * at.aerosol + air.ozone[0] * at.ozone);
                const double all =
                    static_cast<double>(light.scalar_irradiance(h, sun)[0] + light.sunlight(h, sun, true)[0]);
                b.air += weight * r * r * fine.weight[k] * 2 * x * (top - R) * absorbs * all / falls;
            }
            const Vec3 to_sun{std::sqrt(1 - sun * sun), 0, sun};
            const double horizon = -std::sqrt((top - R) * (top + R)) / top;
            for (int half = 0; half < 2; ++half)  // rays that meet the ground, and those that pass it
                for (std::size_t n = 0; n < coarse.node.size(); ++n) {
                    const double span = half == 0 ? -1 - horizon : -horizon;
                    const double up = horizon + span * coarse.node[n] * coarse.node[n];
                    const double solid = 2 * coarse.node[n] * std::abs(span) * coarse.weight[n] * kPi / 8 * 2;
                    const double range = ray_to_ground(air, top, up);
                    for (int a = 0; a < 8; ++a) {
                        const double phi = kPi * (a + 0.5) / 8, sine = std::sqrt(1 - up * up);
                        const Vec3 d{sine * std::cos(phi), sine * std::sin(phi), up}, from{0, 0, top};
                        const auto segment = light.along(from, d, range, to_sun);
                        auto seen = static_cast<double>(segment.in_scattering[0]);
                        if (half == 0) {
                            const double there = dot(normalized(from + range * d), to_sun);
                            const double lit =
                                static_cast<double>(light.ground_irradiance(there)[0]) +
                                static_cast<double>(light.sunlight(0, there, true)[0]) * std::max(0.0, there);
                            seen += albedo / kPi * lit * scaled(segment.columns);
                        }
                        b.scattered += weight * top * top * solid * -up * seen / falls;
                    }
                }
        }
    return b;
}

TEST(ScatteredLight, LosesNoEnergy) {
    for (const double turbidity : {1.0, 3.0}) {
        AirDescription description = earth_air(turbidity);
        description.ground_albedo = 0.3;
        const ScatteredLight light(Air(description, 450e-9), {}, kSunRadius, 2);
        const Balance b = balance(light);
        std::printf("[ energy   ] turbidity %.0f: past %.4f, scattered %.4f, ground %.4f, air %.4f, sum %.4f\n",
                    turbidity, b.passes, b.scattered, b.ground, b.air, b.sum());
        EXPECT_NEAR(b.sum(), 1, 0.005);
    }
}

TEST(ScatteredLight, IsThatOfPathTracedAir) {
    struct View {
        double elevation, zenith, azimuth;
    };
    const auto compare = [](double turbidity, double wavelength_m, std::initializer_list<View> views,
                            double most = 0.03) {
        const AirDescription description = earth_air(turbidity);
        const ScatteredLight light(Air(description, wavelength_m), {}, kSunRadius, 2);
        const Vec3 from{0, 0, description.ground_radius_m + 10};
        for (const View& v : views) {
            const Vec3 d = direction_in_air(v.zenith, v.azimuth), to_sun = direction_in_air(90 - v.elevation, 0);
            const auto seen = static_cast<double>(light.along(from, d, kInfinity, to_sun).in_scattering[0]);
            const PathTracedLight brute = path_traced_air(description, wavelength_m, from, d, to_sun, 10'000);
            EXPECT_NEAR(seen, brute.radiance, 3 * brute.error + most * brute.radiance)
                << turbidity << " " << v.elevation << " " << v.zenith << " " << v.azimuth;
        }
    };
    compare(1, 450e-9, {{60, 0, 0}, {10, 75, 90}, {3, 45, 180}});
    compare(3, 550e-9, {{60, 45, 90}, {30, 75, 180}, {10, 60, 0}});
    compare(6, 630e-9, {{30, 30, 90}});
    // Close to a low Sun in haze, of light that the aerosol has scattered forward again and again.
    compare(3, 550e-9, {{10, 82, 8}, {10, 79, 0}}, 0.02);
    compare(3, 550e-9, {{3, 86, 0}, {3, 87, 4}, {3, 83, 0}}, 0.05);
}

TEST(ScatteredLight, OfTheLimbIsThatOfPathTracedAir) {
    const AirDescription description = earth_air(1);
    const ScatteredLight light(Air(description, kGreen_m), {}, kSunRadius, 2);
    for (const double height : {5e3, 20e3, 40e3}) {
        const Vec3 from{-3e6, 0, description.ground_radius_m + height}, d{1, 0, 0}, to_sun{0.6, 0, 0.8};
        const auto seen = static_cast<double>(light.along(from, d, kInfinity, to_sun).in_scattering[0]);
        const PathTracedLight brute = path_traced_air(description, kGreen_m, from, d, to_sun, 10'000);
        EXPECT_NEAR(seen, brute.radiance, 4 * brute.error + 0.02 * brute.radiance) << height;
    }
}

TEST(ScatteredLight, IsDarkAtNightAndInVacuum) {
    const AirDescription description = earth_air();
    const ScatteredLight light(Air(description, kGreen_m), {}, kSunRadius, 2);
    const Vec3 above{0, 0, description.ground_radius_m + 100'000};
    EXPECT_EQ(light.along(above, {0, 0, 1}, kInfinity, {0, 0, 1}).in_scattering[0], 0);
    EXPECT_EQ(light.along(above, {0, 0, 1}, kInfinity, {0, 0, 1}).columns.gas, 0);
    const Vec3 ground{0, 0, description.ground_radius_m};
    const auto day = light.along(ground, {0, 0, 1}, kInfinity, direction_in_air(45, 0)).in_scattering[0];
    const auto twilight = light.along(ground, {0, 0, 1}, kInfinity, direction_in_air(96, 0)).in_scattering[0];
    const auto night = light.along(ground, {0, 0, 1}, kInfinity, direction_in_air(150, 0)).in_scattering[0];
    EXPECT_GT(day, 100 * twilight);
    EXPECT_GT(twilight, 1e-9f);
    EXPECT_LT(night, 1e-6f * day);
}

TEST(AirBands, ConvergeWithTheirWavelengths) {
    // Of sunlight's transmittance at 10 degrees of elevation, the worst of the bands against 8 wavelengths each.
    const auto through = [](int per_band, double zenith_deg) {
        const Air air(earth_air(), per_band);
        return transmittance_of(air, columns_along(air, PanelRule(32), {0, 0, air.ground_radius_m()},
                                                   direction_in_air(zenith_deg, 0), kInfinity));
    };
    const Rgb exact = through(8, 80), two = through(2, 80), one = through(1, 80);
    for (int band = 0; band < 3; ++band) EXPECT_NEAR(two[band] / exact[band], 1, 0.0012F) << band;
    EXPECT_GT(std::abs(one.z / exact.z - 1), std::abs(two.z / exact.z - 1));
}

TEST(MarsAir, IsButterscotchByDayAndBlueAboutTheSettingSun) {
    const Air air(mars_air(), 2);
    const ScatteredLight light(air, {}, 0.003, 2);
    const Vec3 from{0, 0, air.ground_radius_m() + 2};
    const Rgb day = bands_of(
        air, light.along(from, direction_in_air(60, 120), kInfinity, direction_in_air(40, 0)).in_scattering);
    EXPECT_GT(day.x, 1.2f * day.z);
    const Rgb aureole =
        bands_of(air, light.along(from, direction_in_air(80, 0), kInfinity, direction_in_air(85, 0)).in_scattering);
    EXPECT_GT(aureole.z / aureole.x, 1.2f * day.z / day.x);
}

}  // namespace
}  // namespace narpa
