// What the chaser's camera and LiDAR see of the docking scene along the approach.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/constants.h"
#include "renderer/frame/camera_image.h"
#include "renderer/lidar/lidar_shot.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/cameras.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

class DockingSensors : public testing::Test {
protected:
    static void SetUpTestSuite() {
        const auto path = std::filesystem::path(test::build_path("scenes/docking/docking.toml"));
        Result<Scene> read = read_scene(path.string());
        ASSERT_TRUE(read.has_value()) << read.error().text();
        scene = new Scene(std::move(*read));
        Result<RenderScene> built = RenderScene::create(*scene);
        ASSERT_TRUE(built.has_value()) << built.error().text();
        render_scene = new RenderScene(std::move(*built));
    }
    static void TearDownTestSuite() {
        delete render_scene;
        delete scene;
    }
    /// The chaser on the port's axis, facing it.
    static BodyPoses at_distance(double x_m) {
        BodyPoses at(2);
        at.set(0, scene->bodies[0].initial.T_world_body);
        at.set(1, {{0, 0, 0, 1}, {x_m, 0, 0}});
        return at;
    }
    static inline Scene* scene = nullptr;
    static inline RenderScene* render_scene = nullptr;
};

/// A quarter of the camera's resolution, the same view.
struct View {
    int station_pixels = 0, chaser_pixels = 0;
    double sunlit_high = 0, shadow_low = 0;  ///< 95th and 5th percentile of the station's radiance
};
View look(const RenderScene& render_scene, const BodyPoses& at, Camera camera) {
    const Pinhole p = test::pinhole_of(camera);
    camera.width /= 4, camera.height /= 4;
    test::set_pinhole(camera, p.fx / 4, p.fy / 4, 0.5 * (camera.width - 1), 0.5 * (camera.height - 1));
    RadianceImage image(camera.width, camera.height);
    Aovs aovs;
    const Rigid3 T_world_camera = at.T_world_body[static_cast<std::size_t>(camera.mount)] * camera.T_mount_camera;
    render_radiance(render_scene, at, camera, T_world_camera, {}, image, &aovs);
    View view;
    std::vector<float> radiance;
    for (std::size_t i = 0; i < aovs.body.size(); ++i) {
        view.chaser_pixels += aovs.body[i] == 1;
        if (aovs.body[i] == 0) radiance.push_back(image.pixels[i].y);
    }
    view.station_pixels = static_cast<int>(radiance.size());
    std::sort(radiance.begin(), radiance.end());
    if (!radiance.empty()) {
        view.sunlit_high = static_cast<double>(radiance[radiance.size() * 95 / 100]);
        view.shadow_low = static_cast<double>(radiance[radiance.size() * 5 / 100]);
    }
    return view;
}

TEST_F(DockingSensors, StationGrowsInTheCameraLitAndShadowedAndTheChaserStaysOutOfIt) {
    int before = 0;
    for (const double x_m : {60.0, 35.0, 10.0, 3.0, 0.5, 0.0}) {
        const View view = look(*render_scene, at_distance(x_m), scene->cameras[0]);
        EXPECT_EQ(view.chaser_pixels, 0) << "at " << x_m << " m";
        EXPECT_GE(view.station_pixels, before) << "at " << x_m << " m";
        if (x_m >= 3) {
            EXPECT_GT(view.sunlit_high, 100) << "at " << x_m << " m";
            EXPECT_LT(view.shadow_low, 0.1 * view.sunlit_high) << "at " << x_m << " m";
        }
        before = view.station_pixels;
    }
    EXPECT_EQ(before, 160 * 120);
}

TEST_F(DockingSensors, LidarSeesTheStationAheadAndTheChaserOnlyBehind) {
    const Lidar& lidar = scene->lidars[0];
    for (const double x_m : {60.0, 10.0, 0.0}) {
        const BodyPoses at = at_distance(x_m);
        const Rigid3 T = at.T_world_body[static_cast<std::size_t>(lidar.mount)] * lidar.T_mount_lidar;
        int on_station = 0;
        for (int elevation = -15; elevation <= 15; elevation += 2)
            for (int azimuth = -90; azimuth < 90; ++azimuth) {
                const double e = elevation * kRadPerDeg, a = azimuth * kRadPerDeg;
                const Ray beam{T.t, T.q * Vec3{std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e)}};
                const LidarReturn seen =
                    shoot(render_scene->tracer(), at, beam, {.range_max_m = lidar.range_max_m});
                on_station += seen.body == 0;
                if (std::abs(azimuth) <= 60) {
                    EXPECT_NE(seen.body, 1) << azimuth << " deg, " << elevation << " deg";
                }
            }
        EXPECT_GT(on_station, x_m > 50 ? 15 : 200) << "at " << x_m << " m";
    }
}

}  // namespace
}  // namespace narpa
