// Frames taken over time: tile culling changes no byte of them.
#include <gtest/gtest.h>

#include <random>

#include "renderer/projection/double_sphere.h"
#include "tests/renderer/camera/camera_support.h"

namespace narpa {
namespace {

using namespace test;

/// A turning body, a body that turns and moves across the image, small ones that are fast, one at rest.
struct MovingView {
    Scene scene;
    BodyPoses at{5};

    explicit MovingView(std::mt19937_64& random) {
        std::uniform_real_distribution<double> unit(-1, 1);
        scene.materials.push_back(lambert(0.6f));
        add_mesh(scene, bumpy(3, 1, 0.3), {random_attitude(random), {0.5 * unit(random), 0.5 * unit(random), 6}});
        add_mesh(scene, box(0.1, 3, 0.1), {random_attitude(random), {2 * unit(random), 2 * unit(random), 8}});
        add_sphere(scene, 0.05, {unit(random), unit(random), 5});
        add_sphere(scene, 0.4, {2 * unit(random), 2 * unit(random), 9});
        add_mesh(scene, box(1, 1, 1), {random_attitude(random), {3 * unit(random), 3 * unit(random), 10}});
        add_sun(scene, {0.4, -0.5, -1});
        for (std::size_t b = 0; b < 5; ++b) {
            const Rigid3 start = scene.bodies[b].initial.T_world_body;
            const Vec3 turn = (b < 2 ? 0.7 * unit(random) : 0) * random_direction(random);
            const Vec3 way = (b == 0 || b == 4 ? 0 : unit(random)) * random_direction(random);
            at.set(b, start, {normalized(start.q * exp_rotation(turn)), start.t + way});
        }
    }
};

TEST(MovingFrames, CullingChangesNoByte) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> unit(-1, 1);
    const Camera pinhole = camera(90, 70, 80);
    std::vector<Camera> cameras(4, pinhole);
    cameras[1].model = brown_conrady(pinhole_of(pinhole), {-0.2, 0.05, 1e-3, 1e-3, 0});
    cameras[2].model = kannala_brandt(pinhole_of(pinhole), {-0.02, 0.004, 0, 0});
    cameras[2].optics.lens = Lens{0.1, 7};
    cameras[3].model = make_projection({&kDoubleSphere, pinhole_of(pinhole), {-0.2, 0.6}});
    for (std::size_t i = 0; i < 24; ++i) {
        const MovingView view(random);
        const auto render_scene = RenderScene::create(view.scene, 1);
        ASSERT_TRUE(render_scene);
        const Camera& c = cameras[i % 4];
        const Rigid3 start{{}, {0, 0, 0.5 * unit(random)}};
        const Rigid3 end = i % 3 == 0 ? start
                                      : Rigid3{exp_rotation(0.3 * unit(random) * random_direction(random)),
                                               start.t + 0.3 * unit(random) * random_direction(random)};
        const CameraPose pose(start, end, i % 2 == 0 ? 0 : 0.9 / c.height);
        FrameSettings settings;
        settings.spp = i % 8 == 7 ? 1 : 4;
        settings.frame = static_cast<std::uint32_t>(i);
        if (i % 6 == 5) settings.method = RenderSettings::Method::path;
        const RadianceImage culled = rendered(*render_scene, view.at, c, pose, settings);
        settings.mechanisms.tile_culling = false;
        EXPECT_EQ(culled.pixels, rendered(*render_scene, view.at, c, pose, settings).pixels) << i;
    }
}

// The Sun's disc crosses tiles that see neither it at mid-exposure nor a body.
TEST(MovingFrames, CullingKeepsTheSunsDisc) {
    Scene scene;
    scene.materials.push_back(lambert(0.6f));
    add_sphere(scene, 0.2, {0, 2, 8});
    add_sun(scene, {0, -0.2, 1});
    scene.sun->angular_diameter_rad = 0.03;
    FrameSettings settings;
    settings.spp = 16;
    settings.method = RenderSettings::Method::path;
    const Camera c = camera(90, 70, 80);
    const CameraPose pose({exp_rotation({0, -0.2, 0}), {}}, {exp_rotation({0, 0.2, 0}), {}});
    const RadianceImage culled = rendered(scene, c, pose, settings);
    settings.mechanisms.tile_culling = false;
    EXPECT_EQ(culled.pixels, rendered(scene, c, pose, settings).pixels);
}

}  // namespace
}  // namespace narpa
