// The derivative of rendered images with respect to the pose, against differences of converged renders.
//
// The difference of two images is the integral of the derivative along the way between their poses, exactly and
// however far apart these are: so the poses can be so far apart that the noise of the renders does not matter.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "estimator/dense/image_derivative.h"
#include "estimator/view/model_view.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/cameras.h"
#include "tests/support/paths.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

constexpr int kNodes = 4;  ///< of the integral, at the middles of as many parts

Camera pinhole(int size, double f) {
    Camera c;
    c.width = c.height = size;
    test::set_pinhole(c, f, f, 0.5 * (size - 1), 0.5 * (size - 1));
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

/// Along the way from one to the other side of the pose: RMS over the pixels of (integral of the derivative -
/// difference of the images), over the RMS of the difference.
double relative_error(const RenderScene& render_scene, const Camera& camera, std::size_t target, const Rigid3& pose,
                      const Vector6& half, const Renders& r) {
    const BodyPoses at = placement_of(render_scene.scene());
    const SensorModel sensor = unit_sensor();
    ImageDerivative derivative(render_scene, camera, target, at);
    ModelView view(render_scene, camera, target, at);
    derivative.begin_frame(at, r.motion, r.times);
    view.begin_frame(at, r.motion, r.times);
    FrameSettings many;
    many.budget.kind = FrameBudget::Kind::rays;
    many.budget.rays = static_cast<std::uint64_t>(r.rays_per_pixel * camera.width * camera.height);
    view.render(displaced(pose, half), many, false);
    const auto ahead = view.radiance().pixels;
    view.render(displaced(pose, -half), many, false);
    const auto& behind = view.radiance().pixels;
    std::vector<double> integral(ahead.size());
    for (int i = 0; i < kNodes; ++i) {
        const double place = (2 * i + 1.0) / kNodes - 1;
        const auto J = derivative.at(displaced(pose, place * half), sensor, {}, r.fineness);
        for (std::size_t p = 0; p < integral.size(); ++p)
            integral[p] += 2.0 / kNodes * J[p].cast<double>().dot(half);
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
    return std::sqrt(error2 / size2);
}

/// Of each column.
std::array<double, 6> relative_errors(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                                      const Rigid3& pose, const Renders& r) {
    std::array<double, 6> out{};
    for (int k = 0; k < 6; ++k) {
        const double half = k < 3 ? r.half_rad : k < 5 ? r.half_m : r.half_ahead_m;
        out[static_cast<std::size_t>(k)] =
            relative_error(render_scene, camera, target, pose, half * Vector6::Unit(k), r);
    }
    return out;
}

Scene ellipsoid_of(const Material& material) {
    Scene s;
    s.sun = Sun{normalized(Vec3{0.6, -0.3, -0.7}), 1361, 0.0093};
    s.ambient = {20, 20, 20};
    s.materials.push_back(material);
    s.bodies.push_back({"ball", exact_ellipsoid({1, 1.4, 0.8}), {}, {}});
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
    m.kind = &kinds::phong;
    m.diffuse = {0.2f, 0.2f, 0.2f};
    m.specular = {0.6f, 0.6f, 0.6f};
    m.exponent = 12;
    expect_right(m, 0.05);
}

TEST(ImageDerivative, OfRoughMetal) {
    Material m;
    m.kind = &kinds::ggx;
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
    camera.optics.point_spread = PointSpreadFunction{.sigma_px = 0.8};
    Renders r;
    r.half_rad = 1.6e-2, r.half_m = r.half_ahead_m = 3.2e-2;
    r.motion = {{0.6, 0.3, -0.5}, {0.1, 0.2, 0.1}};
    r.times = {-23.5 * 6e-3, 6e-3, 0.1};
    const auto errors = relative_errors(*render_scene, camera, 0, kTenMetresAhead, r);
    for (std::size_t k = 0; k < 6; ++k) EXPECT_LT(errors[k], 0.08) << "column " << k;
}

Scene box_of(const Vec3& sides_m) {
    Scene s;
    s.sun = Sun{normalized(Vec3{0.3, -0.4, -0.85}), 1361, 0};
    s.ambient = {20, 20, 20};
    s.materials.push_back(test::lambert(0.5f));
    test::add_mesh(s, test::box(sides_m.x, sides_m.y, sides_m.z));
    return s;
}

/// Of the image by a unit of this motion: RMS over the pixels.
double rms_change(std::span<const PixelDerivative> J, const Vector6& motion) {
    double sum = 0;
    for (const PixelDerivative& pixel : J) sum += std::pow(pixel.cast<double>().dot(motion), 2);
    return std::sqrt(sum / static_cast<double>(J.size()));
}

/// Of a cube whose side is seen nearly edge-on, both its edges in one pixel, the motion that the image holds least:
/// edges' ranges and places must be right for all other motions to cancel in it.
TEST(ImageDerivative, OfAFaceSeenNearlyEdgeOn) {
    const Scene scene = box_of({2, 2, 2});
    const auto render_scene = RenderScene::create(scene);
    ASSERT_TRUE(render_scene);
    const Camera camera = pinhole(64, 150);
    const BodyPoses at = placement_of(scene);
    ImageDerivative derivative(*render_scene, camera, 0, at);
    const auto J_at = [&](const Rigid3& pose, int fineness) {
        const auto J = derivative.at(pose, unit_sensor(), {}, fineness);
        return std::vector<PixelDerivative>(J.begin(), J.end());
    };
    for (const double turn : {0.12, 0.15}) {  // hidden up to 0.11
        const Rigid3 pose{exp_rotation({0.2 * turn, turn, 0.1}), {0, 0, 10}};
        Matrix6 information = Matrix6::Zero();
        const auto fine = J_at(pose, 32);
        for (const PixelDerivative& pixel : fine)
            information += pixel.cast<double>() * pixel.cast<double>().transpose();
        Vector6 unit;
        unit << 1, 1, 1, 10, 10, 10;
        const Matrix6 scaled = unit.asDiagonal() * information * unit.asDiagonal();
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(scaled);
        const Vector6 held_min = unit.asDiagonal() * eigen.eigenvectors().col(0);
        EXPECT_NEAR(rms_change(J_at(pose, 4), held_min) / rms_change(fine, held_min), 1, 0.15) << turn;
        Renders r;
        r.fineness = 4;
        EXPECT_LT(relative_error(*render_scene, camera, 0, pose, 0.005 * held_min, r), 0.3) << turn;
    }
}

/// An edge that moves along itself changes nothing, wherever in its pixels it lies.
TEST(ImageDerivative, OfAnEdgeAlongItself) {
    const Scene scene = box_of({2, 60, 2});
    const auto render_scene = RenderScene::create(scene);
    ASSERT_TRUE(render_scene);
    const Camera camera = pinhole(64, 150);
    const BodyPoses at = placement_of(scene);
    ImageDerivative derivative(*render_scene, camera, 0, at);
    for (const double slope : {0.1, 0.5, 0.7, 2.0}) {
        const Quat q = exp_rotation({0, 0, -std::atan(slope)});
        const Vec3 along = q * Vec3{0, 1, 0}, across = q * Vec3{1, 0, 0};
        Vector6 slides = Vector6::Zero(), moves = slides;
        slides.tail<3>() = to_eigen(along), moves.tail<3>() = to_eigen(across);
        const auto J = derivative.at({q, {0, 0, 10}}, unit_sensor(), {}, 4);
        EXPECT_LT(rms_change(J, slides), 0.01 * rms_change(J, moves)) << "slope " << slope;
    }
}

/// Textures, creases, shadows, parts before parts: ten metres before the port.
TEST(ImageDerivative, OfTheDockingScene) {
    const auto scene = read_scene(test::build_path("scenes/docking/docking.toml"));
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
    test::set_principal_point(camera, 10, 5);
    const auto errors = relative_errors(*render_scene, camera, 0, inverse(T_world_camera), r);
    for (std::size_t k = 0; k < 6; ++k) EXPECT_LT(errors[k], 0.17) << "column " << k;
}

/// Pixels that are not chosen are left out; the others do not depend on it.
TEST(ImageDerivative, IsOfTheChosenPixelsOnly) {
    const auto scene = read_scene(test::build_path("scenes/docking/docking.toml"));
    ASSERT_TRUE(scene) << scene.error().text();
    const auto render_scene = RenderScene::create(*scene);
    ASSERT_TRUE(render_scene);
    const Rigid3 pose = inverse(
        Rigid3{scene->bodies[1].initial.T_world_body.q * scene->cameras[0].T_mount_camera.q, {10, 0.4, -0.3}});
    Camera camera = pinhole(40, 400);
    test::set_principal_point(camera, 10, 5);
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
