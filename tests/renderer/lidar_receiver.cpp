// What a LiDAR reports of surfaces, edges and walls: against closed forms of footprint, link budget and noise.
#include "renderer/lidar/lidar_receiver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "renderer/light/render_scene.h"
#include "tests/renderer/camera_support.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
using Echo = LidarReceiverModel::Echo;

/// Shots from the origin, along z unless said otherwise, at plates.
class Range {
public:
    explicit Range(std::vector<double> albedos) {
        for (const double a : albedos) scene.materials.push_back(lambert(static_cast<float>(a)));
    }
    /// A plate whose middle is at this distance, tilted about y, as far to the side as `x_m` says.
    void add(double distance_m, double tilt_rad, double width_m, double x_m = 0, std::uint16_t material = 0) {
        Mesh mesh = plate(width_m, width_m);
        mesh.face_material.assign(mesh.faces.size(), material);
        const Quat q = exp_rotation({0, kPi - tilt_rad, 0});
        add_mesh(scene, mesh, {q, {x_m, 0, distance_m}});
    }
    std::vector<LidarReturn> shoot(const LidarReceiverModel& model, std::size_t n, std::uint64_t seed = 1) const {
        const auto render_scene = RenderScene::create(scene, 1);
        EXPECT_TRUE(render_scene);
        const BodyPoses at = placed(scene);
        LidarReceiver receiver(model, 1e5, seed, 0);
        std::vector<LidarReturn> out(n);
        for (std::size_t first = 0; first < n; first += kLanes) {
            RayBatch beams;
            for (; beams.n < std::min(kLanes, n - first); ++beams.n) beams.put(beams.n, {{}, {0, 0, 1}});
            receiver.receive(render_scene->tracer(), at, beams, first, std::span(out).subspan(first));
        }
        return out;
    }

    Scene scene;
};

struct Spread {
    double mean = 0, deviation = 0;
};
Spread of_ranges(const std::vector<LidarReturn>& returns) {
    Spread s;
    const auto n = static_cast<double>(returns.size());
    for (const LidarReturn& r : returns) s.mean += r.range_m / n;
    for (const LidarReturn& r : returns) s.deviation += std::pow(r.range_m - s.mean, 2) / n;
    s.deviation = std::sqrt(s.deviation);
    return s;
}

TEST(LidarReceiver, WithNothingModelledIsTheShotItself) {
    Range range({0.5});
    range.add(20, 0.3, 10);
    for (const LidarReturn& r : range.shoot({}, 20)) {
        EXPECT_NEAR(r.range_m, 20, 1e-9);
        EXPECT_NEAR(r.reflectivity, 0.5 * std::cos(0.3), 1e-6);
        EXPECT_EQ(r.body, 0);
    }
}

TEST(LidarReceiver, BiasAndNoiseAreThoseOfTheScene) {
    Range range({0.5});
    range.add(20, 0, 10);
    constexpr std::size_t kShots = 100'000;
    const auto returns = range.shoot({.range_bias_m = 0.05, .range_noise_m = 0.03}, kShots);
    const auto [mean, deviation] = of_ranges(returns);
    EXPECT_NEAR(mean, 20.05, 3 * 0.03 / std::sqrt(kShots));
    EXPECT_NEAR(deviation, 0.03, 0.02 * 0.03);
    // Normal, and independent from shot to shot.
    double beyond = 0, product = 0;
    for (std::size_t i = 0; i < kShots; ++i) {
        beyond += std::abs(returns[i].range_m - mean) > 2 * deviation;
        if (i > 0) product += (returns[i].range_m - mean) * (returns[i - 1].range_m - mean);
    }
    EXPECT_NEAR(beyond / kShots, 0.0455, 0.002);
    EXPECT_LT(std::abs(product / kShots), 3 * 0.03 * 0.03 / std::sqrt(kShots));
}

TEST(LidarReceiver, BiasAloneIsExact) {
    Range range({0.5});
    range.add(20, 0, 10);
    for (const LidarReturn& r : range.shoot({.range_bias_m = -0.25}, 20)) EXPECT_NEAR(r.range_m, 19.75, 1e-9);
    for (const LidarReturn& r : range.shoot({.range_bias_m = -20.5}, 20)) EXPECT_EQ(r.body, -1);
}

TEST(LidarReceiver, DrawsDependOnSeedAndShotAlone) {
    Range range({0.5});
    range.add(20, 0.4, 10);
    const LidarReceiverModel model{.beam_divergence_rad = 3e-3, .sub_rays = 16, .range_noise_m = 0.02};
    const auto once = range.shoot(model, 100), again = range.shoot(model, 37), other = range.shoot(model, 37, 2);
    for (std::size_t i = 0; i < again.size(); ++i) {
        EXPECT_EQ(once[i].range_m, again[i].range_m);
        EXPECT_NE(once[i].range_m, other[i].range_m);
    }
}

/// H15: a footprint spread of range * divergence * tan(incidence); mean bias of a tilted plane at most 1 % of it.
TEST(LidarReceiver, TiltedPlanesAreAtTheRangeOfTheAxis) {
    constexpr double kRange_m = 1000, kDivergence = 1e-3;
    for (const double incidence_deg : {0.0, 45.0, 60.0, 80.0, 85.0})
        for (const int sub_rays : {32, 64}) {
            const double tilt = incidence_deg * kPi / 180, spread_m = kRange_m * kDivergence * std::tan(tilt);
            Range range({0.5});
            range.add(kRange_m, tilt, 400);
            const auto [mean, deviation] =
                of_ranges(range.shoot({.beam_divergence_rad = kDivergence, .sub_rays = sub_rays}, 2000));
            EXPECT_NEAR(mean, kRange_m, 0.01 * spread_m + 1e-3) << incidence_deg;
            EXPECT_LT(deviation, 0.05 * spread_m + 1e-3) << incidence_deg;
        }
}

/// Where a beam meets an edge there are two echoes, and never one in between, unless they are closer than a pulse.
TEST(LidarReceiver, AnEdgeGivesOneOfTwoEchoesOrTheirMean) {
    // The near plate takes what is left of x = 1 cm: at 50 m and 3 mrad, 58 % of the footprint and more than half.
    const double share =
        0.5 + (std::asin(0.01 / 0.075) + 0.01 / 0.075 * std::sqrt(1 - std::pow(0.01 / 0.075, 2))) / kPi;
    for (const double apart_m : {0.5, 3.0}) {
        Range range({0.4, 0.8});
        range.add(50, 0, 10, -4.99);
        range.add(50 + apart_m, 0, 40, 0, 1);
        const LidarReceiverModel model{.beam_divergence_rad = 3e-3, .sub_rays = 64, .pulse_length_m = 0.9};
        LidarReceiverModel last = model;
        last.echo = Echo::last;
        // Light of each: its share times its reflectivity.
        const double near = 0.4 * share / (50 * 50), far = 0.8 * (1 - share) / std::pow(50 + apart_m, 2);
        const double mean = (50 * near + (50 + apart_m) * far) / (near + far);
        for (const LidarReturn& r : range.shoot(model, 200)) {
            if (apart_m < model.pulse_length_m) {
                EXPECT_NEAR(r.range_m, mean, 0.05 * apart_m);
            } else {
                EXPECT_NEAR(r.range_m, far > near ? 53 : 50, 1e-3);
                EXPECT_NEAR(r.reflectivity, far > near ? 0.8 * (1 - share) : 0.4 * share, 0.04);  // 64 sub-rays
            }
        }
        if (apart_m < model.pulse_length_m) continue;
        for (const LidarReturn& r : range.shoot(last, 200)) EXPECT_NEAR(r.range_m, 53, 1e-3);
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
                Range range({albedo});
                range.add(factor * limit_m, tilt, 20);
                LidarReceiverModel model{.range_at_10_percent_m = 40};
                if (sub_rays > 1) model.sub_rays = sub_rays, model.beam_divergence_rad = 1e-3;
                const LidarReturn r = range.shoot(model, 1)[0];
                EXPECT_EQ(r.range_m > 0, factor < 1) << albedo << " " << tilt << " " << sub_rays;
                EXPECT_EQ(r.body, factor < 1 ? 0 : -1);
            }
}

/// The weaker of two echoes is the last only where it is detected.
TEST(LidarReceiver, LastIsTheLastThatIsDetected) {
    Range range({0.4, 0.1});
    range.add(50, 0, 10, -5);
    range.add(60, 0, 40, 0, 1);
    LidarReceiverModel model{.beam_divergence_rad = 3e-3, .sub_rays = 32, .echo = Echo::last};
    for (const auto& [range_at_10_percent_m, expected_m] : {std::pair{100.0, 60.0}, {70.0, 50.0}, {30.0, 0.0}}) {
        model.range_at_10_percent_m = range_at_10_percent_m;
        for (const LidarReturn& r : range.shoot(model, 50)) EXPECT_NEAR(r.range_m, expected_m, 1e-3);
    }
}

}  // namespace
}  // namespace narpa
