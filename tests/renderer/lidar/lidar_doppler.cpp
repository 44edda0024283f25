// Line-of-sight velocities against closed forms and independent reference numbers.
#include <gtest/gtest.h>

#include "renderer/lidar/lidar_shot.h"
#include "renderer/light/render_scene.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/oracle.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

Vec3 doppler_vec(const nlohmann::json& j) {
    return {j[0], j[1], j[2]};
}

/// A beam on a sphere that moves and turns: range to 1e-9 m, velocity to 1e-9 m/s.
TEST(LidarDoppler, IsTheLineOfSightVelocityOfTheMaterialPoint) {
    NEED_ORACLE(oracle, "lidar_doppler");
    int met = 0;
    for (const auto& c : oracle["cases"]) {
        const auto &in = c["in"], &expected = c["out"];
        Scene scene;
        scene.materials.push_back(lambert(0.5f));
        add_sphere(scene, in["radius"], doppler_vec(in["body_center"]));
        scene.bodies.push_back({.name = "sensor", .shape = exact_sphere(1e-9)});
        const auto render_scene = RenderScene::create(scene, 1);
        ASSERT_TRUE(render_scene);
        BodyPoses at(2);
        at.set(0, {{}, doppler_vec(in["body_center"])});
        at.set(1, {{}, doppler_vec(in["sensor_pos"]) - Vec3{0, 0, 1}});
        const std::vector<Motion> motions{
            {.velocity_m_s = doppler_vec(in["body_vel"]), .rate_rad_s = doppler_vec(in["body_omega"])},
            {.velocity_m_s = doppler_vec(in["sensor_vel"])}};
        const LidarReturn r = shoot(render_scene->tracer(), at,
                                    {doppler_vec(in["sensor_pos"]), normalized(doppler_vec(in["beam_dir"]))},
                                    {.range_max_m = 1e12, .motions = motions, .mount = 1});
        if (!expected.contains("range_m") || expected["range_m"].is_null()) {
            EXPECT_EQ(r.body, -1) << c["description"];
            continue;
        }
        ++met;
        EXPECT_NEAR(r.range_m, expected["range_m"], 1e-9 * std::max(1.0, 1e-6 * r.range_m)) << c["description"];
        EXPECT_NEAR(r.velocity_m_s, expected["los_velocity"], 1e-9) << c["description"];
        EXPECT_NEAR(r.cos_incidence, expected["cos_incidence"], 1e-6) << c["description"];
    }
    EXPECT_GT(met, 10);
}

/// The LiDAR turns with its mount: a point 2 m to the side of the body's origin moves at 2 m times the rate.
TEST(LidarDoppler, HasTheLeverOfTheMount) {
    Scene scene;
    scene.materials.push_back(lambert(0.5f));
    add_mesh(scene, plate(50, 50), {exp_rotation({0, kPi, 0}), {0, 0, 30}});
    scene.bodies.push_back({.name = "chaser", .shape = exact_sphere(1e-9)});
    const auto render_scene = RenderScene::create(scene, 1);
    ASSERT_TRUE(render_scene);
    BodyPoses at = placed(scene);
    const Quat q = exp_rotation({0.3, -0.2, 0.5});
    at.set(1, {q, {}});
    const Vec3 rate_world{0, 0.1, 0}, lever{2, 0, 0};
    const std::vector<Motion> motions{{}, {.velocity_m_s = {0, 0, 0.5}, .rate_rad_s = conjugate(q) * rate_world}};
    const LidarReturn r =
        shoot(render_scene->tracer(), at, {lever, {0, 0, 1}}, {.range_max_m = 100, .motions = motions, .mount = 1});
    EXPECT_NEAR(r.range_m, 30, 1e-9);
    EXPECT_NEAR(r.velocity_m_s, -0.5 + 2 * 0.1, 1e-12) << "rate x lever is (0, 0, -0.2)";
}

/// By way of a mirror at rest the rate of the whole path; a mirror that comes closer shortens it twice.
TEST(LidarDoppler, OfAMirroredPathIsTheRateOfItsLength) {
    Scene scene;
    scene.materials.push_back(lambert(0.5f));
    scene.materials.push_back(lambert(0));
    scene.materials.back().kind = &kinds::mirror;
    scene.materials.back().specular = {1, 1, 1};
    Mesh mirror = plate(3, 3);
    mirror.face_material.assign(mirror.faces.size(), 1);
    add_mesh(scene, mirror, {exp_rotation({0, kPi, 0}), {0, 0, 10}});
    add_mesh(scene, plate(3, 3), {{}, {0, 0, -4}});
    const auto render_scene = RenderScene::create(scene, 1);
    ASSERT_TRUE(render_scene);
    const std::vector<Motion> motions{{.velocity_m_s = {0.7, 0, -0.25}}, {.velocity_m_s = {0, 0, -1}}};
    const LidarReturn r = shoot(render_scene->tracer(), placed(scene), {{}, {0, 0, 1}},
                                {.range_max_m = 100, .multipath = true, .motions = motions});
    EXPECT_NEAR(r.range_m, 24, 1e-9);
    EXPECT_NEAR(r.velocity_m_s, 2 * -0.25 + 1, 1e-12);
}

}  // namespace
}  // namespace narpa
