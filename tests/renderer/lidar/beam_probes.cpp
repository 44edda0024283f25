// Beams on flat surfaces, of which the probes alone are traced: against all of many more sub-rays.
#include "renderer/lidar/beam_probes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/renderer/camera/camera_support.h"
#include "tests/renderer/lidar/lidar_support.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kBeam_rad = 3e-3;
constexpr int kAllTraced = 4096;  // more than a scene may ask for: all are traced

std::vector<LidarEchoes> echoes_of(const Scene& scene, int sub_rays, std::size_t shots) {
    const auto render_scene = RenderScene::create(scene, 1);
    EXPECT_TRUE(render_scene);
    return shots_along({0, 0, 1}, *render_scene,
                       {.beam_divergence_rad = kBeam_rad, .sub_rays = sub_rays, .pulse_length_m = 0.3}, shots);
}

/// A wide plate, tilted about y, of colour 0.5.
Scene wall_at(double range_m, double incidence_rad) {
    Scene scene;
    scene.materials.push_back(lambert(0.5f));
    add_mesh(scene, plate(20, 20), {exp_rotation({0, kPi - incidence_rad, 0}), {0, 0, range_m}});
    return scene;
}

/// Returns of probes that meet a plane of this tilt.
std::vector<LidarReturn> on_plane(const BeamCone& cone, std::size_t probes, double range_m, double slope) {
    std::vector<LidarReturn> returns(probes);
    for (std::size_t k = 0; k < probes; ++k) {
        const Vec3 u = normalized(Vec3{cone.x(k), cone.y(k), 1});
        const Vec3 n = normalized(Vec3{slope, 0.3 * slope, -1});
        returns[k] = {.range_m = -range_m / dot(n, u) / std::sqrt(1 + 1.09 * slope * slope),
                      .reflectivity = static_cast<float>(-dot(n, u)),
                      .body = 0,
                      .cos_incidence = static_cast<float>(-dot(n, u))};
    }
    return returns;
}

TEST(BeamProbes, FirstRaysOfAConeCoverItsDisc) {
    for (const int rays : {24, 32, 64}) {
        const BeamCone cone(kBeam_rad, rays);
        const std::size_t probes = BeamProbes(cone).size();
        ASSERT_EQ(probes, 12u);
        EXPECT_LT(std::hypot(cone.x(0), cone.y(0)), 0.2 * cone.tangent()) << "near the axis";
        // The largest disc within the footprint that holds no probe.
        double largest = 0;
        for (double x = -1; x <= 1; x += 0.01)
            for (double y = -1; y <= 1; y += 0.01) {
                double radius = 1 - std::hypot(x, y);
                for (std::size_t k = 0; k < probes; ++k)
                    radius = std::min(radius,
                                      std::hypot(x - cone.x(k) / cone.tangent(), y - cone.y(k) / cone.tangent()));
                largest = std::max(largest, radius);
            }
        EXPECT_LT(largest * largest, 0.27) << rays;
    }
}

TEST(BeamProbes, ArePartOfTheConeOnlyWhereTheyPay) {
    EXPECT_EQ(BeamProbes().size(), 0u);
    for (const int rays : {1, 8, 23}) EXPECT_EQ(BeamProbes(BeamCone(kBeam_rad, rays)).size(), 0u);
    EXPECT_EQ(BeamProbes(BeamCone(0, 32)).size(), 0u) << "a beam without width";
}

TEST(BeamProbes, KnowAPlaneFromWhatIsNone) {
    const BeamCone cone(kBeam_rad, 32);
    const BeamProbes probes(cone);
    BeamProbes::Ratios ratios;
    const double spot_m = 10 * cone.tangent();
    for (const double slope : {0.0, 1.0, 5.0}) {
        const std::vector<LidarReturn> plane = on_plane(cone, probes.size(), 10, slope);
        EXPECT_TRUE(probes.lie_on_plane(plane, ratios)) << slope;
        for (std::size_t k = 0; k < probes.size(); ++k) {
            std::vector<LidarReturn> step = plane, hole = plane, other = plane;
            step[k].range_m += 0.2 * spot_m * std::sqrt(1 + slope * slope);
            hole[k].range_m = 0;
            other[k].body = 1;
            EXPECT_FALSE(probes.lie_on_plane(step, ratios)) << slope << " " << k;
            EXPECT_FALSE(probes.lie_on_plane(hole, ratios)) << slope << " " << k;
            EXPECT_FALSE(probes.lie_on_plane(other, ratios)) << slope << " " << k;
        }
    }
    EXPECT_FALSE(probes.lie_on_plane(on_plane(cone, probes.size(), 10, 12), ratios)) << "85 degrees";
}

/// The integrals over the cone are exact, so that single shots have no noise of their sub-rays.
TEST(BeamProbes, EveryShotAtAPlaneIsTheMeanOverItsFootprint) {
    for (const double incidence_deg : {0.0, 45.0, 75.0, 83.0}) {
        const double incidence = incidence_deg * kPi / 180, spread_m = 10 * kBeam_rad * std::tan(incidence);
        const Scene scene = wall_at(10, incidence);
        double range_m = 0, reflectivity = 0;
        constexpr std::size_t kShots = 50;
        for (const LidarEchoes& e : echoes_of(scene, kAllTraced, kShots)) {
            range_m += e.strongest.range_m / kShots;
            reflectivity += static_cast<double>(e.strongest.reflectivity) / kShots;
        }
        for (const LidarEchoes& e : echoes_of(scene, 32, kShots)) {
            EXPECT_NEAR(e.strongest.range_m, range_m, 2e-4 * spread_m + 1e-7) << incidence_deg;
            EXPECT_NEAR(e.strongest.reflectivity, reflectivity, 2e-4 * reflectivity) << incidence_deg;
            EXPECT_EQ(e.second.range_m, 0);
        }
    }
}

/// On a curved surface the probes' own mean counts.
TEST(BeamProbes, CurvedSurfacesAreAtTheMeanOfTheirFootprint) {
    for (const double radius_m : {0.1, 0.3, 3.0}) {
        Scene scene;
        scene.materials.push_back(lambert(0.5f));
        const double aside_m = 0.7 * radius_m;
        add_sphere(scene, radius_m, {aside_m, 0, 10});
        const double sagitta_m = std::pow(10 * kBeam_rad / 2, 2) / (2 * radius_m) * std::pow(1 - 0.49, -1.5);
        double range_m = 0, reference_m = 0;
        constexpr std::size_t kShots = 500;
        for (const LidarEchoes& e : echoes_of(scene, 32, kShots)) range_m += e.strongest.range_m / kShots;
        for (const LidarEchoes& e : echoes_of(scene, kAllTraced, 20)) reference_m += e.strongest.range_m / 20;
        EXPECT_NEAR(range_m, reference_m, 0.05 * sagitta_m + 1e-6) << radius_m;
    }
}

/// A bar a metre in front of a wall, of this share of the footprint's diameter, somewhere in the footprint.
TEST(BeamProbes, BarsBetweenThemAreMissedAsRarelyAsIsSaid) {
    constexpr double kNear_m = 10, kFar_m = 11;
    const double spot_m = kNear_m * kBeam_rad;  // diameter
    for (const auto& [share, least] : {std::pair{0.1, 0.75}, {0.2, 0.96}, {0.3, 1.0}}) {
        int found = 0, places = 0;
        for (double place = -1; place <= 1; place += 0.04, ++places) {
            Scene scene = wall_at(kFar_m, 0.3);
            const double aside_m = place * 0.5 * (1 - share) * spot_m;
            add_mesh(scene, plate(share * spot_m, 1), {exp_rotation({0, kPi, 0}), {aside_m, 0, kNear_m}});
            for (const LidarEchoes& e : echoes_of(scene, 32, 64)) found += e.second.range_m > 0;
        }
        EXPECT_GE(found, least * 64 * places) << share;
    }
}

/// A retroreflector of a hundredth of the footprint, 1000 times as bright as the wall that it is on.
TEST(BeamProbes, SmallRetroreflectorsCountInFull) {
    Scene scene = wall_at(10, 0);
    scene.materials.push_back(lambert(0.5f));
    scene.materials[1].retroreflectance = 499.5f;
    const double side_m = 0.5 * 10 * kBeam_rad * std::sqrt(0.01 * kPi);
    Mesh cube = plate(side_m, side_m);
    cube.face_material.assign(cube.faces.size(), 1);
    add_mesh(scene, cube, {exp_rotation({0, kPi, 0}), {0.004, 0, 10 - 1e-4}});
    double reflectivity = 0;
    constexpr std::size_t kShots = 2000;
    for (const LidarEchoes& e : echoes_of(scene, 32, kShots))
        reflectivity += static_cast<double>(e.strongest.reflectivity) / kShots;
    // 0.99 of the wall, 0.01 of 500; a shot has it in 0 or 1 of its 32 sub-rays.
    EXPECT_NEAR(reflectivity, 0.99 * 0.5 + 0.01 * 500, 0.6);
}

}  // namespace
}  // namespace narpa
