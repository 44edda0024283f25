// What air sends back of a LiDAR's pulse: the lidar equation for even air, and echoes that are no surface.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/constants.h"
#include "renderer/atmosphere/lidar_air.h"
#include "renderer/lidar/lidar_receiver.h"
#include "renderer/light/render_scene.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/renderer/lidar/lidar_support.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kGate_m = 0.9;

/// Pi beta times the integral of exp(-2 alpha r) / r^2, by 2000 midpoints.
double lidar_equation(double pi_beta_1_m, double alpha_1_m, double from_m, double to_m) {
    constexpr int kSteps = 2000;
    const double step = (to_m - from_m) / kSteps;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double r = from_m + (i + 0.5) * step;
        sum += step * std::exp(-2 * alpha_1_m * r) / (r * r);
    }
    return pi_beta_1_m * sum;
}

AirDescription even_air(double turbidity) {
    AirDescription air = earth_air(turbidity);
    air.gas_height_m = air.aerosol_height_m = 1e12;
    return air;
}

TEST(LidarAir, OfEvenAirIsTheLidarEquation) {
    AirDescription description = even_air(1);
    description.gas_amount = 300;  // dense: two optical depths in a kilometre or so
    const double wavelength_m = 905e-9;
    const LidarAir air(description, wavelength_m, 12);
    const AirCoefficients c = coefficients(description, wavelength_m);
    ASSERT_GT(c.gas_scattering, 4e-4);
    const double pi_beta = std::numbers::pi * c.gas_scattering * 3 / (8 * std::numbers::pi);
    const Vec3 from{0, 0, description.ground_radius_m + 10}, level{1, 0, 0};
    EXPECT_NEAR(air.max_1_m(), pi_beta, 1e-9 * pi_beta);
    for (const auto& [near_m, far_m] : {std::pair{0.9, 1.8}, {5.0, 5.9}, {100.0, 101.0}, {400.0, 800.0}}) {
        const LidarAir::Return back = air.backscattered(from, level, near_m, far_m);
        const double expected = lidar_equation(pi_beta, c.gas_scattering, near_m, far_m);
        EXPECT_NEAR(back.light, expected, 1e-5 * expected) << near_m;
        EXPECT_GT(back.range_m, near_m);
        EXPECT_LT(back.range_m, far_m);
    }
    // Of a short gate: P = pi beta (c tau / 2) T^2 / R^2.
    const double thin = pi_beta * 0.5 * std::exp(-2 * c.gas_scattering * 300.0) / (300.0 * 300.0);
    EXPECT_NEAR(air.backscattered(from, level, 299.75, 300.25).light, thin, 1e-5 * thin);
    EXPECT_NEAR(air.transmittance(from, level, 300), std::exp(-300 * c.gas_scattering), 1e-6);
}

TEST(LidarAir, ThinsOutWithHeight) {
    const AirDescription description = earth_air(3);
    const LidarAir air(description, 905e-9, 12);
    const AirCoefficients c = coefficients(description, 905e-9);
    const AirBackscatter b = backscatter(description, c);
    const Vec3 from{0, 0, description.ground_radius_m}, up{0, 0, 1};
    for (const double h : {10.0, 1000.0, 3000.0}) {
        const double gas = std::exp(-h / description.gas_height_m),
                     aerosol = std::exp(-h / description.aerosol_height_m);
        const double depth = c.gas_scattering * description.gas_height_m * (1 - gas) +
                             c.aerosol_extinction * description.aerosol_height_m * (1 - aerosol);
        const double expected =
            std::numbers::pi * (b.gas * gas + b.aerosol * aerosol) * std::exp(-2 * depth) * 1.0 / (h * h);
        EXPECT_NEAR(air.backscattered(from, up, h - 0.5, h + 0.5).light, expected, 0.01 * expected) << h;
    }
    EXPECT_EQ(air.backscattered(from, up, 70'000, 70'001).light, 0);
}

TEST(LidarAir, LidarRatioIsThePhaseFunctionsOrTheScenes) {
    AirDescription description = earth_air(3);
    const AirCoefficients c = coefficients(description, 905e-9);
    // Henyey and Greenstein's at 180 degrees: (1 - g) / (4 pi (1 + g)^2).
    const double g = c.asymmetry, phase = (1 - g) / (4 * std::numbers::pi * (1 + g) * (1 + g));
    EXPECT_NEAR(backscatter(description, c).aerosol, c.aerosol_scattering * phase, 1e-9 * c.aerosol_scattering);
    EXPECT_NEAR(c.aerosol_extinction / backscatter(description, c).aerosol, 180, 2);
    description.aerosol_lidar_ratio_sr = 50;
    EXPECT_DOUBLE_EQ(backscatter(description, c).aerosol, c.aerosol_extinction / 50);
}

/// Even fog.
class Fog final : public LidarMedium {
public:
    Fog(double pi_beta_1_m, double alpha_1_m) : pi_beta_1_m_(pi_beta_1_m), alpha_1_m_(alpha_1_m) {}
    [[nodiscard]] double transmittance(const BodyPoses&, const Ray&, double range_m) const noexcept override {
        return std::exp(-alpha_1_m_ * range_m);
    }
    [[nodiscard]] double in_scattering(const BodyPoses&, const Ray&, double, double) const noexcept override {
        return 0;
    }
    [[nodiscard]] Backscatter backscatter(const BodyPoses&, const Ray&, double from_m,
                                          double to_m) const noexcept override {
        return {lidar_equation(pi_beta_1_m_, alpha_1_m_, from_m, to_m), 0.5 * (from_m + to_m)};
    }
    [[nodiscard]] double max_backscatter_1_m() const noexcept override { return pi_beta_1_m_; }

private:
    double pi_beta_1_m_, alpha_1_m_;
};

/// Shots along z, at a white plate at a distance, or at none.
std::vector<LidarEchoes> shots_in(const LidarMedium* medium, const LidarReceiverModel& model, double plate_m,
                                  std::size_t n, std::uint64_t seed = 1) {
    Scene scene;
    scene.materials.push_back(lambert(0.5f));
    if (plate_m > 0) add_mesh(scene, plate(10, 10), {exp_rotation({0, kPi, 0}), {0, 0, plate_m}});
    const auto render_scene = RenderScene::create(scene, 1);
    EXPECT_TRUE(render_scene);
    return shots_along({0, 0, 1}, *render_scene, model, n, {.seed = seed, .medium = medium});
}

/// 10 % at 1000 m: the least light is 1e-7; fog of pi beta * gate = 1e-5 crosses it up to 10 m.
constexpr double kPiBeta_1_m = 1e-5 / kGate_m, kMin = 1e-7;
LidarReceiverModel receiver_from(double range_min_m, double snr = 0) {
    return {
        .pulse_length_m = kGate_m, .range_min_m = range_min_m, .range_at_10_percent_m = 1000, .detection_snr = snr};
}

TEST(LidarInFog, AnEchoStandsWhereTheReceiverBeginsToListen) {
    const Fog fog(kPiBeta_1_m, 1e-4);
    for (const LidarEchoes& e : shots_in(&fog, receiver_from(2), 0, 20)) {
        EXPECT_GE(e.strongest.range_m, 2);
        EXPECT_LE(e.strongest.range_m, 2 + kGate_m);
        const double light = lidar_equation(kPiBeta_1_m, 1e-4, 2, 2 + kGate_m);
        EXPECT_NEAR(e.strongest.reflectivity, light * e.strongest.range_m * e.strongest.range_m, 1e-3 * light * 9);
        EXPECT_EQ(e.last.range_m, e.strongest.range_m);
    }
    // Too faint where it listens from 12 m on; and for a receiver that is not so sensitive.
    for (const LidarEchoes& e : shots_in(&fog, receiver_from(12), 0, 20)) EXPECT_EQ(e.strongest.range_m, 0);
    LidarReceiverModel dull = receiver_from(2);
    dull.range_at_10_percent_m = 100;
    for (const LidarEchoes& e : shots_in(&fog, dull, 0, 20)) EXPECT_EQ(e.strongest.range_m, 0);
    // Without a threshold nothing crosses it.
    LidarReceiverModel ideal = receiver_from(2);
    ideal.range_at_10_percent_m = 0;
    for (const LidarEchoes& e : shots_in(&fog, ideal, 0, 20)) EXPECT_EQ(e.strongest.range_m, 0);
}

TEST(LidarInFog, ASurfaceBehindIsSeenToo) {
    const Fog fog(kPiBeta_1_m, 1e-4);
    for (const LidarEchoes& e : shots_in(&fog, receiver_from(2), 50, 20)) {
        EXPECT_NEAR(e.strongest.range_m, 50, 1e-6);
        EXPECT_NEAR(e.strongest.reflectivity, 0.5 * std::exp(-2 * 1e-4 * 50), 1e-4);
        EXPECT_LE(e.second.range_m, 2 + kGate_m);
        EXPECT_GE(e.second.range_m, 2);
        EXPECT_EQ(e.last.range_m, e.strongest.range_m);
    }
}

TEST(LidarInFog, LightOfTheGateAddsToASurfacesEcho) {
    const Fog fog(0.1, 0);  // dense: pi beta * gate = 0.09
    for (const LidarEchoes& e : shots_in(&fog, receiver_from(4.5), 5, 20))
        EXPECT_NEAR(e.strongest.reflectivity, 0.5 + 0.1 * kGate_m * 5 / (5 - 0.5 * kGate_m), 1e-3);
}

TEST(LidarInFog, FalseEchoesComeAsOftenAsTheThresholdSays) {
    const Fog fog(kPiBeta_1_m, 0);
    constexpr double kSnr = 5, kFrom_m = 9.5;
    constexpr std::size_t kShots = 20'000;
    double missed = 1;
    for (double r = kFrom_m; r < 30; r += kGate_m) {
        const double x = lidar_equation(kPiBeta_1_m, 0, r, r + kGate_m) / kMin;
        missed *= 1 - 0.5 * std::erfc(kSnr * (1 - x) / std::numbers::sqrt2);
    }
    const auto shots = shots_in(&fog, receiver_from(kFrom_m, kSnr), 0, kShots);
    double found = 0, beyond_first = 0;
    for (const LidarEchoes& e : shots) {
        found += e.strongest.range_m > 0;
        beyond_first += e.strongest.range_m > kFrom_m + kGate_m;
    }
    const double expected = 1 - missed;
    ASSERT_GT(expected, 0.3);
    ASSERT_LT(expected, 0.9);
    EXPECT_NEAR(found / kShots, expected, 4 * std::sqrt(expected * missed / kShots));
    EXPECT_GT(beyond_first, 0);
    // By the seed, and by nothing else.
    const auto again = shots_in(&fog, receiver_from(kFrom_m, kSnr), 0, 500),
               other = shots_in(&fog, receiver_from(kFrom_m, kSnr), 0, 500, 2);
    std::size_t differ = 0;
    for (std::size_t i = 0; i < again.size(); ++i) {
        EXPECT_EQ(again[i].strongest.range_m, shots[i].strongest.range_m);
        differ += again[i].strongest.range_m != other[i].strongest.range_m;
    }
    EXPECT_GT(differ, 50U);
}

TEST(LidarInFog, DrawsOfSurfacesAreThoseOfAVacuum) {
    // Clear: no gate is looked at, and nothing else changes.
    const Fog clear(1e-12, 0);
    LidarReceiverModel model = receiver_from(2, 5);
    model.range_noise_m = 0.02;
    const auto in_vacuum = shots_in(nullptr, model, 700, 200), in_air = shots_in(&clear, model, 700, 200);
    for (std::size_t i = 0; i < in_air.size(); ++i) {
        EXPECT_EQ(in_air[i].strongest.range_m, in_vacuum[i].strongest.range_m);
        EXPECT_EQ(in_air[i].strongest.reflectivity, in_vacuum[i].strongest.reflectivity);
    }
}

}  // namespace
}  // namespace narpa
