// The derivative of rendered images with respect to the pose, against differences of converged renders.
//
// The difference of two images is the integral of the derivative along the way between their poses, exactly and
// however far apart these are: so the poses can be so far apart that the noise of the renders does not matter.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "estimator/dense/image_derivative.h"
#include "estimator/view/model_view.h"
#include "renderer/scene/scene_file.h"

namespace narpa {
namespace {

constexpr int kNodes = 4;  ///< of the integral, at the middles of as many parts

Camera pinhole(int size, double f) {
    Camera c;
    c.width = c.height = size;
    c.fx = c.fy = f;
    c.cx = c.cy = 0.5 * (size - 1);
    return c;
}

SensorModel unit_sensor() {
    SensorModel s;
    s.dn_per_radiance = {1, 1, 1};
    s.top_dn = 1e9;
    return s;
}

BodyPoses placement_of(const Scene& scene) {
    BodyPoses at(scene.bodies.size());
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) at.set(b, scene.bodies[b].initial.T_world_body);
    return at;
}

struct Renders {
    int fineness = 8;
    double rays_per_pixel = 300;
    double half_rad = 0, half_m = 0, half_ahead_m = 0;  ///< way to either side; along the camera's axis
    ApparentMotion motion{};
    RowTimes times{};
};

/// Of each column: RMS over the pixels of (integral of the derivative - difference of the images), over the RMS of
/// the difference.
std::array<double, 6> relative_errors(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                                      const Rigid3& pose, const Renders& r) {
    const BodyPoses at = placement_of(render_scene.scene());
    const SensorModel sensor = unit_sensor();
    ImageDerivative derivative(render_scene, camera, target, at);
    ModelView view(render_scene, camera, target, at);
    derivative.begin_frame(at, r.motion, r.times);
    view.begin_frame(at, r.motion, r.times);
    FrameSettings many;
    many.budget.kind = FrameBudget::Kind::rays;
    many.budget.rays = static_cast<std::uint64_t>(r.rays_per_pixel * camera.width * camera.height);
    std::array<double, 6> out{};
    for (int k = 0; k < 6; ++k) {
        const double half = k < 3 ? r.half_rad : k < 5 ? r.half_m : r.half_ahead_m;
        view.render(displaced(pose, half * Vector6::Unit(k)), many, false);
        const auto ahead = view.radiance().pixels;
        view.render(displaced(pose, -half * Vector6::Unit(k)), many, false);
        const auto& behind = view.radiance().pixels;
        std::vector<double> integral(ahead.size());
        for (int i = 0; i < kNodes; ++i) {
            const double place = (2 * i + 1.0) / kNodes - 1;
            const auto J = derivative.at(displaced(pose, place * half * Vector6::Unit(k)), sensor, {}, r.fineness);
            for (std::size_t p = 0; p < integral.size(); ++p)
                integral[p] += 2 * half / kNodes * static_cast<double>(J[p][k]);
        }
        double error2 = 0, size2 = 0;
        for (int y = 1; y < camera.height - 1; ++y)
            for (int x = 1; x < camera.width - 1; ++x) {
                const auto p = static_cast<std::size_t>(y * camera.width + x);
                const Rgb d = ahead[p] - behind[p];
                const double difference = static_cast<double>(d.x + d.y + d.z);
                error2 += std::pow(integral[p] - difference, 2);
                size2 += difference * difference;
            }
        out[static_cast<std::size_t>(k)] = std::sqrt(error2 / size2);
    }
    return out;
}

Scene ellipsoid_of(const Material& material) {
    Scene s;
    s.sun = Sun{normalized(Vec3{0.6, -0.3, -0.7}), 1361, 0.0093};
    s.ambient = {20, 20, 20};
    s.materials.push_back(material);
    s.bodies.push_back({"ball", Ellipsoid{{1, 1.4, 0.8}, 0}, {}, {}});
    return s;
}

const Rigid3 kTenMetresAhead{normalized(Quat{0.9, 0.2, -0.3, 0.1}), {0.1, -0.05, 10}};

void expect_right(const Material& material, double tolerance) {
    const Scene scene = ellipsoid_of(material);
    const auto render_scene = RenderScene::create(scene);
    ASSERT_TRUE(render_scene);
    Renders r;
    r.half_rad = 1.6e-2, r.half_m = r.half_ahead_m = 3.2e-2;  // half a pixel
    const auto errors = relative_errors(*render_scene, pinhole(48, 150), 0, kTenMetresAhead, r);
    for (std::size_t k = 0; k < 6; ++k) EXPECT_LT(errors[k], tolerance) << "column " << k;
}

TEST(ImageDerivative, OfALambertEllipsoid) {
    Material m;
    m.diffuse = {0.6f, 0.6f, 0.6f};
    expect_right(m, 0.08);  // most of it is the rim
}

TEST(ImageDerivative, OfALobeThatFollowsTheViewer) {
    Material m;
    m.kind = Material::Kind::phong;
    m.diffuse = {0.2f, 0.2f, 0.2f};
    m.specular = {0.6f, 0.6f, 0.6f};
    m.exponent = 12;
    expect_right(m, 0.05);
}

TEST(ImageDerivative, OfRoughMetal) {
    Material m;
    m.kind = Material::Kind::ggx;
    m.diffuse = {0.8f, 0.8f, 0.8f};
    m.metallic = 1;
    m.roughness = 0.6f;
    expect_right(m, 0.05);
}

/// Behind a lens that blurs, by a rolling shutter, while the target moves by 3 px in the image and 1 px in a row's
/// exposure.
TEST(ImageDerivative, OfARollingShutterAndABlurringLens) {
    Material m;
    m.diffuse = {0.6f, 0.6f, 0.6f};
    const Scene scene = ellipsoid_of(m);
    const auto render_scene = RenderScene::create(scene);
    ASSERT_TRUE(render_scene);
    Camera camera = pinhole(48, 150);
    camera.point_spread = PointSpreadFunction{.sigma_px = 0.8};
    Renders r;
    r.half_rad = 1.6e-2, r.half_m = r.half_ahead_m = 3.2e-2;
    r.motion = {{0.6, 0.3, -0.5}, {0.1, 0.2, 0.1}};
    r.times = {-23.5 * 6e-3, 6e-3, 0.1};
    const auto errors = relative_errors(*render_scene, camera, 0, kTenMetresAhead, r);
    for (std::size_t k = 0; k < 6; ++k) EXPECT_LT(errors[k], 0.08) << "column " << k;
}

/// Textures, creases, shadows, parts before parts: ten metres before the port.
TEST(ImageDerivative, OfTheDockingScene) {
    const auto scene = read_scene(NARPA_BUILD_DIR "/scenes/docking/docking.toml");
    ASSERT_TRUE(scene) << scene.error().text();
    const auto render_scene = RenderScene::create(*scene);
    ASSERT_TRUE(render_scene);
    const Rigid3 T_world_camera{scene->bodies[1].initial.T_world_body.q * scene->cameras[0].T_mount_camera.q,
                                {10, 0.4, -0.3}};
    Renders r;
    r.half_rad = 7e-3, r.half_m = 1.2e-2, r.half_ahead_m = 0.2;
    r.fineness = 8;
    r.rays_per_pixel = 200;
    Camera camera = pinhole(40, 400);
    camera.cx = 10, camera.cy = 5;
    const auto errors = relative_errors(*render_scene, camera, 0, inverse(T_world_camera), r);
    for (std::size_t k = 0; k < 6; ++k) EXPECT_LT(errors[k], 0.17) << "column " << k;
}

/// Pixels that are not chosen are left out; the others do not depend on it.
TEST(ImageDerivative, LooksAtTheChosenPixels) {
    const auto scene = read_scene(NARPA_BUILD_DIR "/scenes/docking/docking.toml");
    ASSERT_TRUE(scene) << scene.error().text();
    const auto render_scene = RenderScene::create(*scene);
    ASSERT_TRUE(render_scene);
    const Rigid3 pose = inverse(
        Rigid3{scene->bodies[1].initial.T_world_body.q * scene->cameras[0].T_mount_camera.q, {10, 0.4, -0.3}});
    Camera camera = pinhole(40, 400);
    camera.cx = 10, camera.cy = 5;
    const BodyPoses at = placement_of(*scene);
    ImageDerivative derivative(*render_scene, camera, 0, at);
    const auto by = [&](std::span<const std::uint8_t> chosen) {
        const auto J = derivative.at(pose, unit_sensor(), {}, 4, chosen);
        return std::vector<PixelDerivative>(J.begin(), J.end());
    };
    std::vector<std::uint8_t> chosen(40 * 40);
    for (std::size_t p = 0; p < chosen.size(); ++p) chosen[p] = p % 3 == 0 ? 1 : 0;
    const auto all = by({}), some = by(chosen);
    int looked_at = 0;
    for (std::size_t p = 0; p < all.size(); ++p) {
        EXPECT_EQ(some[p], chosen[p] != 0 ? all[p] : PixelDerivative(PixelDerivative::Zero())) << p;
        looked_at += some[p].isZero(0) ? 0 : 1;
    }
    EXPECT_GT(looked_at, 300);
}

}  // namespace
}  // namespace narpa
