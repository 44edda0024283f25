// Dense estimates of saturated frames: clipped pixels neither hide a wrong pose nor make a right one worse.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "base/constants.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/cameras.h"
#include "tests/support/paths.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

struct Claims {
    int claimed = 0;
    double worst_deg = 0, worst_part = 0;  ///< attitude; position in parts of the range
};

/// Estimates from frames that are exposed `times` too long, at `range_m` in any attitude, from starts one degree
/// and one per cent off.
Claims claims(const Scene& scene, Camera camera, double times, double range_m, int poses) {
    camera.detector->exposure_s *= times;
    const auto render_scene = RenderScene::create(scene);
    BodyPoses at(scene.bodies.size());
    ModelView view(*render_scene, camera, 0, at);
    DenseAlignment dense(*render_scene, camera, 0);
    DenseOptions o;
    o.samples_per_pixel = 12, o.fineness = 4;
    std::mt19937_64 random(5);
    std::vector<std::uint8_t> bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    Claims out;
    for (int n = 0; n < poses; ++n) {
        const Rigid3 truth{test::random_attitude(random), {0.02 * range_m, -0.03 * range_m, range_m}};
        FrameSettings s;
        s.seed = 99 + static_cast<std::uint64_t>(n);
        s.spp = 64;
        view.render(truth, s, false);
        expose(camera, view.radiance(), 5, static_cast<std::uint32_t>(n), bytes);
        const auto frame = measured_image(camera, bytes);
        const Vec3 axis = test::random_direction(random), way = test::random_direction(random);
        Vector6 off;
        off << kRadPerDeg * Eigen::Vector3d(axis.x, axis.y, axis.z),
            0.01 * range_m * Eigen::Vector3d(way.x, way.y, way.z);
        const auto e = dense.align(*frame, at, displaced(truth, off), o);
        EXPECT_TRUE(e);
        if (!e || e->status != DenseStatus::converged) continue;
        ++out.claimed;
        const Vector6 error = error_between(truth, e->T_camera_body);
        out.worst_deg = std::max(out.worst_deg, error.head<3>().norm() / kRadPerDeg);
        out.worst_part = std::max(out.worst_part, error.tail<3>().norm() / range_m);
    }
    return out;
}

TEST(DenseSaturation, ACubeIsFoundByItsOutline) {
    Scene cube;
    cube.sun = Sun{normalized(Vec3{0.5, -0.4, -0.75}), 1361, 0};
    cube.ambient = {8, 8, 8};
    cube.materials.push_back(test::lambert(0.3f));
    test::add_mesh(cube, test::box(2, 2, 2));
    const Claims c = claims(cube, test::square_camera(128), 30, 6, 6);
    EXPECT_GE(c.claimed, 5);
    EXPECT_LT(c.worst_deg, 0.1);
    EXPECT_LT(c.worst_part, 1e-3);
}

TEST(DenseSaturation, GoodAnswersOnTheStationAreWithinTheirCovariance) {
    auto station = read_scene(test::build_path("scenes/docking/docking.toml"));
    ASSERT_TRUE(station) << station.error().text();
    const Claims c = claims(*station, test::square_camera(128), 30, 30, 6);
    EXPECT_GE(c.claimed, 3);
    EXPECT_LT(c.worst_deg, 0.05);
    EXPECT_LT(c.worst_part, 1e-3);
}

}  // namespace
}  // namespace narpa
