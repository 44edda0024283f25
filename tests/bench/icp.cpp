// ICP of VLP-16 sweeps of the docking station: of the emulator's packets, and the bench with few starts.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "bench/estimation/icp.h"
#include "emulator/lidar/lidar_unit.h"
#include "estimator/cloud/cloud_icp.h"
#include "estimator/cloud/range_points.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

constexpr std::size_t kStation = 0, kChaser = 1;

Scene docking_scene() {
    auto scene = read_scene(test::build_path("scenes/docking/docking.toml"));
    EXPECT_TRUE(scene) << scene.error().text();
    return *std::move(scene);
}

/// Packets as the emulator sends them, with no noise but their rounding; the chaser drifts and rotates.
TEST(SweepPoints, OfEmulatedPacketsLieOnTheStation) {
    Scene scene = docking_scene();
    scene.bodies[kChaser].can_id.reset();
    scene.bodies[kChaser].initial = {{{0, 0, 0, 1}, {30, 2, -1}}, {-1, 0.3, 0.2}, {0.02, -0.03, 0.05}};
    auto world = World::create(std::move(scene));
    ASSERT_TRUE(world) << world.error().text();
    LidarUnit unit(**world, 0);

    // Pose and motion of the station in the LiDAR's frame when the rotor points forward.
    const std::int64_t turn_ns = 100'000'000;
    BodyPoses at(2);
    const auto pose_at = [&](std::int64_t t_ns) {
        (*world)->place(t_ns, -1, at);
        return inverse((*world)->sensor_pose(unit.lidar().mount, unit.lidar().T_mount_lidar, at)) *
               at.T_world_body[kStation];
    };
    const Rigid3 truth = pose_at(turn_ns);
    const Vector6 per_ms = error_between(pose_at(turn_ns - 500'000), pose_at(turn_ns + 500'000));
    const ApparentMotion motion{1e3 * Vec3{per_ms[3], per_ms[4], per_ms[5]},
                                1e3 * Vec3{per_ms[0], per_ms[1], per_ms[2]}};

    const LidarModel& model = *unit.lidar().model;
    LidarSweep sweep;
    SweepReader reader(model);
    const std::int64_t period_ns = unit.packet_period_ns();
    for (std::int64_t packet = turn_ns / 2 / period_ns; packet < 3 * turn_ns / 2 / period_ns; ++packet) {
        unit.fire(packet);
        ASSERT_TRUE(model.packet_time(unit.bytes(), 0));
        reader.append(unit.bytes(), unit.packet_start_ns(packet) - turn_ns, sweep);
    }
    std::vector<RangePoint>& points = sweep.points;
    EXPECT_GT(sweep.empty.size(), points.size());
    std::erase_if(points, [](const RangePoint& p) { return p.range_m < 10; });  // the chaser's own nose
    ASSERT_GT(points.size(), 500u);

    IcpSettings settings;
    settings.noise.range_m = model.spec().range_resolution_m / std::sqrt(12.0);
    CloudIcp icp((*world)->tracer(), kStation, settings);
    Vector6 off;
    off << 0.03, -0.02, 0.04, 0.5, -0.8, 0.4;
    const auto e = icp.align(points, motion, displaced(truth, off), 1.5);
    ASSERT_TRUE(e) << e.error().text();
    EXPECT_TRUE(e->answer.usable());
    const Vector6 error = error_between(e->T_lidar_target, truth);
    EXPECT_LT(error.head<3>().norm(), 1e-4);
    EXPECT_LT(error.tail<3>().norm(), 1e-3) << "half the step of the ranges";
}

TEST(BenchIcp, FindsTheDockingStation) {
    auto world = World::create(docking_scene());
    ASSERT_TRUE(world) << world.error().text();
    int reported = 0;
    const std::vector<IcpStarts> starts{{5, 0.05, 15}, {15, 0.1, 8}};
    const auto runs = run_icp(**world, kStation, starts, [&](int done, int all) {
        EXPECT_EQ(done, ++reported);
        EXPECT_EQ(all, 23);
    });
    ASSERT_EQ(runs.size(), 2u);
    for (const IcpRun& run : runs) {
        EXPECT_EQ(run.found, run.starts);
        EXPECT_GT(run.points, 500);
        // The three axes are correlated: half the degrees of freedom.
        const double chance = 4 / std::sqrt(2.0 * 1.5 * run.starts);
        EXPECT_NEAR(run.rotation_to_bound, 1.03, chance);
        EXPECT_NEAR(run.translation_to_bound, 1.03, chance);
        EXPECT_LT(run.nees, 6 * 1.1 * 1.1 + 4 * std::sqrt(12.0 / run.starts));
    }
    EXPECT_EQ(reported, 23);
    EXPECT_EQ(to_json(runs)[0].at("found"), 15);
    EXPECT_NE(to_text(runs).find("100.0%"), std::string::npos);
}

}  // namespace
}  // namespace narpa
