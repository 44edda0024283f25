// Frames of a world with details that the model lacks. With ModelUncertainty::detail the answer states how far they
// move the pose, or is refused.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "estimator/dense/dense_alignment.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

/// A bumpy body with corners of its own: a boulder, a plate and a mast break its symmetry.
Scene body_of(int level, const Material& material) {
    Scene s;
    s.sun = Sun{normalized(Vec3{0.5, -0.45, -0.7}), 1361, 0};
    s.materials.push_back(material);
    Mesh mesh = test::bumpy(level, 1, 0.25);
    test::append_box(mesh, {0.7, 0.5, 1.2}, {exp_rotation({0.3, 0.2, 0}), {0.7, 0.4, 0.3}});
    test::append_box(mesh, {0.3, 1.4, 0.3}, {exp_rotation({0, 0.4, 0.2}), {-0.6, -0.7, 0.2}});
    mesh.face_material.assign(mesh.faces.size(), 0);
    s.meshes.push_back(std::move(mesh));
    Body body;
    body.shape = 0;
    s.bodies.push_back(std::move(body));
    Camera c = test::square_camera(160);
    c.format = PixelFormat::y16;
    s.cameras.push_back(std::move(c));
    return s;
}

constexpr int kFramesOfDetails = 8;
constexpr double kSixSigma = 50;  ///< NEES

struct Answered {
    int good = 0, refused = 0, beyond = 0;
    double nees = 0;     ///< sum of the good answers'
    std::string errors;  ///< a line for each
};

/// Frames of `world` at random poses, estimated with `model`.
Answered estimate(const Scene& world, const Scene& model, const ModelUncertainty& told) {
    const RenderScene rendered = *RenderScene::create(world), known = *RenderScene::create(model);
    const Camera& camera = model.cameras.front();
    const BodyPoses at(1);
    ModelView view(rendered, world.cameras.front(), 0, BodyPoses(world.bodies.size()));
    DenseAlignment dense(known, camera, 0);
    Answered out;
    for (int k = 0; k < kFramesOfDetails; ++k) {
        std::mt19937_64 random(static_cast<std::uint64_t>(k) + 1);
        const Rigid3 truth{test::random_attitude(random), {0.05, -0.03, 4}};
        FrameSettings settings;
        settings.spp = 64, settings.seed = random();
        view.render(truth, settings, false);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(world.cameras.front(), view.radiance(), random(), 0, bytes);
        DenseOptions options;
        options.model = told;
        options.guess_error = {3 * kDegree, 0.03};
        const Rigid3 guess = displaced(truth, random_error(2 * kDegree, 0.02 * 4, random));
        const auto e = dense.align(*measured_image(camera, bytes), at, guess, options);
        EXPECT_TRUE(e);
        const Vector6 error = error_between(truth, e->T_camera_body);
        const double nees = normalised_error_squared(error, e->covariance);
        out.errors += fmt::format("{}: {:.3f} deg, {:.4f} m; sigma {:.3f} deg; NEES {:.1f}; residual {:.2f}; {}\n",
                                  kAnswerKinds[static_cast<std::size_t>(e->answer.kind)],
                                  error.head<3>().norm() / kDegree, error.tail<3>().norm(),
                                  rotation_sigma(e->covariance) / kDegree, nees, e->residual, e->answer.why);
        if (e->answer.kind == AnswerKind::good)
            ++out.good, out.nees += nees, out.beyond += nees > kSixSigma ? 1 : 0;
        if (e->answer.kind == AnswerKind::refused) ++out.refused;
    }
    return out;
}

constexpr ModelUncertainty kTold{.albedo = 0.2, .detail = 0.2};

void expect_honest(const Answered& a, int good) {
    EXPECT_EQ(a.beyond, 0) << a.errors;
    EXPECT_GE(a.good, good) << a.errors;
    EXPECT_LT(a.nees, 12 * std::max(a.good, 1)) << a.errors;
    testing::Test::RecordProperty("answers", a.errors);
}

/// A mesh with a quarter of the triangles. Calculated from the curvature of the bumps, it is at most about 1 % of
/// the radius inside the surface.
TEST(DenseLackingDetails, ASimplifiedMesh) {
    ModelUncertainty told = kTold;
    told.scale = 0.003, told.mesh_m = 0.003;
    const Material grey = test::lambert(0.3F);
    expect_honest(estimate(body_of(5, grey), body_of(4, grey), told), 4);
}

/// A mesh with a sixteenth of the triangles: about 5 % of the radius inside, more than what is told.
TEST(DenseLackingDetails, AMeshOfAnotherShapeIsRefused) {
    ModelUncertainty told = kTold;
    told.scale = 0.01, told.mesh_m = 0.01;
    const Material grey = test::lambert(0.3F);
    expect_honest(estimate(body_of(5, grey), body_of(3, grey), told), 0);
}

TEST(DenseLackingDetails, AnotherReflectance) {
    Material regolith = test::lambert(0.3F);
    regolith.kind = &kinds::lunar_lambert;
    expect_honest(estimate(body_of(3, regolith), body_of(3, test::lambert(0.3F)), kTold), 5);
}

/// Patches of a fifth of the radius, 20 % darker and brighter.
TEST(DenseLackingDetails, ATextureThatIsMissing) {
    Scene world = body_of(3, test::lambert(0.3F));
    for (const float albedo : {0.24F, 0.36F}) world.materials.push_back(test::lambert(albedo));
    Mesh& mesh = world.meshes.front();
    const auto patch = [](float along) { return static_cast<int>(std::floor(5 * along)) + 10; };
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const Vec3f p = mesh.positions[mesh.faces[f][0]];
        mesh.face_material[f] = static_cast<std::uint16_t>((patch(p.x) + 7 * patch(p.y) + 3 * patch(p.z)) % 3);
    }
    expect_honest(estimate(world, body_of(3, test::lambert(0.3F)), kTold), 5);
}

/// Bright stripes behind the target, which the scene does not have: pixels beside the outline are not compared.
TEST(DenseLackingDetails, AnOutlineBeforeClutter) {
    Scene world = body_of(3, test::lambert(0.3F));
    world.materials.push_back(test::lambert(0.5F));
    Mesh wall;
    for (int i = -6; i <= 6; ++i) test::append_box(wall, {0.4, 10, 0.1}, {{}, {0.8 * i, 0, 6}});
    wall.face_material.assign(wall.faces.size(), 1);
    world.meshes.push_back(std::move(wall));
    Body body;
    body.name = "wall", body.shape = 1;
    world.bodies.push_back(std::move(body));
    expect_honest(estimate(world, body_of(3, test::lambert(0.3F)), kTold), 4);
}

}  // namespace
}  // namespace narpa
