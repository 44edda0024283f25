// What a LiDAR reports of surfaces, edges and walls: against closed forms of footprint, link budget and noise.
#include "renderer/lidar/lidar_receiver.h"

#include <gtest/gtest.h>

#include <cmath>

#include "renderer/light/render_scene.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/renderer/lidar/lidar_support.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// Shots from the origin along z, at plates.
class TargetRange {
public:
    explicit TargetRange(std::vector<double> albedos) {
        for (const double a : albedos) scene.materials.push_back(lambert(static_cast<float>(a)));
    }
    /// A plate whose middle is at this distance, tilted about y, as far to the side as `x_m` says.
    void add(double distance_m, double tilt_rad, double width_m, double x_m = 0, std::uint16_t material = 0) {
        Mesh mesh = plate(width_m, width_m);
        mesh.face_material.assign(mesh.faces.size(), material);
        const Quat q = exp_rotation({0, kPi - tilt_rad, 0});
        add_mesh(scene, mesh, {q, {x_m, 0, distance_m}});
    }
    [[nodiscard]] std::vector<LidarEchoes> shoot(const LidarReceiverModel& model, std::size_t n,
                                                 std::uint64_t seed = 1, double range_max_m = 1e5) const {
        const auto render_scene = RenderScene::create(scene, 1);
        EXPECT_TRUE(render_scene);
        return shots_along({0, 0, 1}, *render_scene, model, n,
                           {.seed = seed, .motions = motions, .range_max_m = range_max_m});
    }

    Scene scene;
    std::vector<Motion> motions;
};

struct Distribution {
    double mean = 0, deviation = 0;
};
Distribution of(const std::vector<double>& values) {
    Distribution d;
    const auto n = static_cast<double>(values.size());
    for (const double x : values) d.mean += x / n;
    for (const double x : values) d.deviation += std::pow(x - d.mean, 2) / n;
    d.deviation = std::sqrt(d.deviation);
    return d;
}
/// Of those that are detected.
std::vector<double> ranges(const std::vector<LidarEchoes>& shots) {
    std::vector<double> out;
    for (const LidarEchoes& e : shots)
        if (e.strongest.range_m > 0) out.push_back(e.strongest.range_m);
    return out;
}

TEST(LidarReceiver, WithNothingModelledIsTheShotItself) {
    TargetRange target({0.5});
    target.add(20, 0.3, 10);
    for (const LidarEchoes& e : target.shoot({}, 20)) {
        EXPECT_NEAR(e.strongest.range_m, 20, 1e-9);
        EXPECT_NEAR(e.strongest.reflectivity, 0.5 * std::cos(0.3), 1e-6);
        EXPECT_EQ(e.last.range_m, e.strongest.range_m);
        EXPECT_EQ(e.second.range_m, 0);
    }
}

TEST(LidarReceiver, BiasAndNoiseAreThoseOfTheScene) {
    TargetRange target({0.5});
    target.add(20, 0, 10);
    constexpr std::size_t kShots = 100'000;
    const auto range_m = ranges(target.shoot({.range_bias_m = 0.05, .range_noise_m = 0.03}, kShots));
    const auto [mean, deviation] = of(range_m);
    EXPECT_NEAR(mean, 20.05, 3 * 0.03 / std::sqrt(kShots));
    EXPECT_NEAR(deviation, 0.03, 0.02 * 0.03);
    // Normal, and independent from shot to shot.
    double beyond = 0, product = 0;
    for (std::size_t i = 0; i < kShots; ++i) {
        beyond += std::abs(range_m[i] - mean) > 2 * deviation;
        if (i > 0) product += (range_m[i] - mean) * (range_m[i - 1] - mean);
    }
    EXPECT_NEAR(beyond / kShots, 0.0455, 0.002);
    EXPECT_LT(std::abs(product / kShots), 3 * 0.03 * 0.03 / std::sqrt(kShots));
}

TEST(LidarReceiver, BiasAloneIsExact) {
    TargetRange target({0.5});
    target.add(20, 0, 10);
    for (const double r : ranges(target.shoot({.range_bias_m = -0.25}, 20))) EXPECT_NEAR(r, 19.75, 1e-9);
    EXPECT_TRUE(ranges(target.shoot({.range_bias_m = -20.5}, 20)).empty());
}

TEST(LidarReceiver, DrawsDependOnSeedAndShotAlone) {
    TargetRange target({0.5});
    target.add(20, 0.4, 10);
    const LidarReceiverModel model{.beam_divergence_rad = 3e-3, .sub_rays = 16, .range_noise_m = 0.02};
    const auto once = target.shoot(model, 100), again = target.shoot(model, 37), other = target.shoot(model, 37, 2);
    for (std::size_t i = 0; i < again.size(); ++i) {
        EXPECT_EQ(once[i].strongest.range_m, again[i].strongest.range_m);
        EXPECT_NE(once[i].strongest.range_m, other[i].strongest.range_m);
    }
}

/// H15: a footprint spread of range * divergence * tan(incidence); mean bias of a tilted plane at most 1 % of it.
TEST(LidarReceiver, TiltedPlanesAreAtTheRangeOfTheAxis) {
    constexpr double kRange_m = 1000, kDivergence = 1e-3;
    for (const double incidence_deg : {0.0, 45.0, 60.0, 80.0, 85.0})
        for (const int sub_rays : {32, 64}) {
            const double tilt = incidence_deg * kPi / 180, spread_m = kRange_m * kDivergence * std::tan(tilt);
            TargetRange target({0.5});
            target.add(kRange_m, tilt, 400);
            const auto [mean, deviation] =
                of(ranges(target.shoot({.beam_divergence_rad = kDivergence, .sub_rays = sub_rays}, 2000)));
            EXPECT_NEAR(mean, kRange_m, 0.01 * spread_m + 1e-3) << incidence_deg;
            EXPECT_LT(deviation, 0.05 * spread_m + 1e-3) << incidence_deg;
        }
}

/// However far apart the ends of its footprint are.
TEST(LidarReceiver, ATiltedPlaneIsOneEcho) {
    TargetRange target({0.5});
    target.add(1000, 85 * kPi / 180, 400);
    for (const int sub_rays : {8, 16, 32, 64}) {
        const LidarReceiverModel model{.beam_divergence_rad = 1e-3, .sub_rays = sub_rays, .pulse_length_m = 0.9};
        int split = 0;
        for (const LidarEchoes& e : target.shoot(model, 4000)) split += e.second.range_m > 0;
        EXPECT_EQ(split, 0) << sub_rays;
    }
}

/// Where a beam meets an edge there are two echoes, and never one in between, unless they are closer than a pulse.
TEST(LidarReceiver, AnEdgeGivesTwoEchoesOrTheirMean) {
    // The near plate takes what is left of x = 1 cm: at 50 m and 3 mrad, 58 % of the footprint.
    const double share =
        0.5 + (std::asin(0.01 / 0.075) + 0.01 / 0.075 * std::sqrt(1 - std::pow(0.01 / 0.075, 2))) / kPi;
    for (const double apart_m : {0.5, 3.0}) {
        TargetRange target({0.4, 0.8});
        target.add(50, 0, 10, -4.99);
        target.add(50 + apart_m, 0, 40, 0, 1);
        const LidarReceiverModel model{.beam_divergence_rad = 3e-3, .sub_rays = 64, .pulse_length_m = 0.9};
        // Light of each: its share times its reflectivity.
        const double near = 0.4 * share / (50 * 50), far = 0.8 * (1 - share) / std::pow(50 + apart_m, 2);
        ASSERT_GT(far, near);
        for (const LidarEchoes& e : target.shoot(model, 200)) {
            if (apart_m < model.pulse_length_m) {
                EXPECT_NEAR(e.strongest.range_m, (50 * near + (50 + apart_m) * far) / (near + far), 0.05 * apart_m);
                EXPECT_EQ(e.second.range_m, 0);
                EXPECT_EQ(e.last.range_m, e.strongest.range_m);
                continue;
            }
            EXPECT_NEAR(e.strongest.range_m, 53, 1e-3);
            EXPECT_NEAR(e.strongest.reflectivity, 0.8 * (1 - share), 0.04);  // 64 sub-rays
            EXPECT_NEAR(e.second.range_m, 50, 1e-3);
            EXPECT_NEAR(e.second.reflectivity, 0.4 * share, 0.03);
            EXPECT_EQ(e.last.range_m, e.strongest.range_m);
            const auto [last, other] = e.reported(LidarReturns::dual);
            EXPECT_EQ(last.range_m, e.last.range_m);
            EXPECT_EQ(other.range_m, e.second.range_m);
        }
    }
}

TEST(LidarReceiver, WeakEchoesAreNotDetected) {
    // 10 % at 40 m; 90 % three times as far; at 60 degrees of incidence half of that light.
    struct Case {
        double albedo, tilt_rad, range_m;
    };
    for (const auto& [albedo, tilt, limit_m] :
         {Case{0.1, 0, 40}, Case{0.9, 0, 120}, Case{0.9, kPi / 3, 120 * std::sqrt(0.5)}})
        for (const int sub_rays : {1, 32})
            for (const double factor : {0.99, 1.01}) {
                TargetRange target({albedo});
                target.add(factor * limit_m, tilt, 20);
                LidarReceiverModel model{.range_at_10_percent_m = 40};
                if (sub_rays > 1) model.sub_rays = sub_rays, model.beam_divergence_rad = 1e-3;
                EXPECT_EQ(target.shoot(model, 1)[0].strongest.range_m > 0, factor < 1)
                    << albedo << " " << tilt << " " << sub_rays;
            }
}

/// The weaker of two echoes is the last only where it is detected.
TEST(LidarReceiver, LastIsTheLastThatIsDetected) {
    TargetRange target({0.4, 0.1});
    target.add(50, 0, 10, -5);
    target.add(60, 0, 40, 0, 1);
    LidarReceiverModel model{.beam_divergence_rad = 3e-3, .sub_rays = 32};
    for (const auto& [range_at_10_percent_m, expected_m] : {std::pair{100.0, 60.0}, {70.0, 50.0}, {30.0, 0.0}}) {
        model.range_at_10_percent_m = range_at_10_percent_m;
        for (const LidarEchoes& e : target.shoot(model, 50)) EXPECT_NEAR(e.last.range_m, expected_m, 1e-3);
    }
}

/// Phi(snr * (strength / s - 1)) of the shots are detected, in the dark and with sunlight's noise.
TEST(LidarReceiver, DetectionIsASoftLimitThatSunlightMoves) {
    constexpr std::size_t kShots = 20'000;
    for (const bool lit : {false, true})
        for (const double strength : {0.7, 0.9, 1.0, 1.2, 1.5}) {
            TargetRange target({0.5});
            const double limit_m = 40 * std::sqrt(5.0);  // of 50 %
            target.add(limit_m / std::sqrt(strength), 0, 50);
            if (lit) target.scene.sun = Sun{.direction = normalized(Vec3{0, 3, -4})};
            const LidarReceiverModel model{.range_at_10_percent_m = 40, .detection_snr = 5, .sunlight_noise = 2};
            // Half of white, at a cosine of 0.8.
            const double s = lit ? std::sqrt(1 + 2 * 0.5 * 0.8) : 1;
            const double expected = 0.5 * std::erfc(5 * (1 - strength / s) / std::sqrt(2));
            const double share = static_cast<double>(ranges(target.shoot(model, kShots)).size()) / kShots;
            EXPECT_NEAR(share, expected, 4 * std::sqrt(std::max(1e-4, expected * (1 - expected)) / kShots))
                << strength;
        }
}

TEST(LidarReceiver, NoiseAndWalkGrowAsTheEchoWeakens) {
    constexpr std::size_t kShots = 100'000;
    for (const double strength : {1.1, 4.0, 25.0}) {
        TargetRange target({0.5});
        const double range_m = 40 * std::sqrt(5 / strength);
        target.add(range_m, 0, 50);
        const auto [mean, deviation] = of(ranges(target.shoot({.range_at_10_percent_m = 40,
                                                               .range_noise_m = 0.01,
                                                               .range_noise_at_limit_m = 0.08,
                                                               .range_walk_m = 0.2},
                                                              kShots)));
        const double expected = std::hypot(0.01, 0.08 / strength);
        EXPECT_NEAR(deviation, expected, 0.02 * expected) << strength;
        EXPECT_NEAR(mean - range_m, 0.2 / strength, 4 * expected / std::sqrt(kShots) + 1e-4) << strength;
    }
}

/// The link budget: light falls with cos(incidence) / range^2 until it is lost; a retroreflector is found far
/// beyond.
TEST(LidarReceiver, RetroreflectorsAreFoundFarBeyondDiffuseSurfaces) {
    for (const float retro : {0.0f, 99.5f}) {
        TargetRange target({0.5});
        target.scene.materials[0].retroreflectance = retro;
        target.add(500, kPi / 3, 50);
        const LidarEchoes e = target.shoot({.range_at_10_percent_m = 40}, 1)[0];
        EXPECT_EQ(e.strongest.range_m > 0, retro > 0);
        if (retro > 0) {
            EXPECT_NEAR(e.strongest.reflectivity, 50, 1e-3) << "100 times white, at a cosine of one half";
        }
    }
}

/// A mirror at 45 degrees, 10 m ahead, and a plate 7 m to its side.
TEST(LidarReceiver, MirrorsSendNothingBackUnlessBeamsGoOn) {
    TargetRange target({0.5, 0.5});
    target.scene.materials[1].kind = &kinds::mirror;
    target.scene.materials[1].specular = {0.9f, 0.9f, 0.9f};
    target.add(10, kPi / 4, 3, 0, 1);
    add_mesh(target.scene, plate(4, 4), {exp_rotation({0, kPi / 2, 0}), {-7, 0, 10}});
    add_mesh(target.scene, plate(4, 4), {exp_rotation({0, kPi / 2, 0}), {7, 0, 10}});
    EXPECT_TRUE(ranges(target.shoot({.range_at_10_percent_m = 1000}, 1)).empty());
    const LidarEchoes e =
        target.shoot({.multipath = LidarReceiverModel::Multipath::mirrors, .range_at_10_percent_m = 1000}, 1)[0];
    EXPECT_NEAR(e.strongest.range_m, 17, 1e-6);
    EXPECT_NEAR(e.strongest.reflectivity, 0.5 * 0.9 * 0.9, 1e-5);
}

TEST(LidarReceiver, RangesAndVelocitiesBeyondTheirAmbiguityWrap) {
    TargetRange target({0.5});
    target.add(1234.5, 0, 500);
    target.motions = {{.velocity_m_s = {0, 0, -13}}};
    const LidarEchoes e = target.shoot({.range_ambiguity_m = 150, .velocity_ambiguity_m_s = 20}, 1, 1, 150)[0];
    EXPECT_NEAR(e.strongest.range_m, 1234.5 - 8 * 150, 1e-6);
    EXPECT_NEAR(e.strongest.velocity_m_s, 7, 1e-9);
}

TEST(LidarReceiver, EchoesOutsideItsLimitsAreLost) {
    TargetRange target({0.5});
    target.add(20, 0, 10);
    EXPECT_TRUE(ranges(target.shoot({}, 1, 1, 19.9)).empty());
    EXPECT_TRUE(ranges(target.shoot({.range_min_m = 20.1}, 1)).empty());
    EXPECT_EQ(ranges(target.shoot({.range_min_m = 19.9}, 1, 1, 20.1)).size(), 1u);
}

TEST(LidarReceiver, VelocityNoiseIsThatOfTheScene) {
    constexpr std::size_t kShots = 100'000;
    TargetRange target({0.5});
    target.add(20, 0, 10);
    target.motions = {{.velocity_m_s = {3, 2, -0.4}}};
    std::vector<double> velocities;
    for (const LidarEchoes& e : target.shoot({.range_noise_m = 0.1, .velocity_noise_m_s = 0.05}, kShots))
        velocities.push_back(e.strongest.velocity_m_s);
    const auto [mean, deviation] = of(velocities);
    EXPECT_NEAR(mean, -0.4, 4 * 0.05 / std::sqrt(kShots));
    EXPECT_NEAR(deviation, 0.05, 0.02 * 0.05);
}

}  // namespace
}  // namespace narpa
