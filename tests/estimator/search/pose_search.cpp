// Poses without a guess: found at any attitude, ambiguous where the target is symmetric, refused where it is not
// there.
#include "estimator/search/pose_search.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <string>

#include "base/constants.h"
#include "estimator/search/attitude_grid.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

/// A bus, two unlike panels and a mast: no two of its sides are alike.
Mesh small_craft() {
    Mesh m;
    test::append_box(m, {1.4, 1, 0.9}, {});
    test::append_box(m, {0.8, 1.6, 0.06}, {exp_rotation({0, 0.4, 0}), {0.2, 1.3, 0}});
    test::append_box(m, {0.6, 0.9, 0.06}, {exp_rotation({0, -0.4, 0}), {-0.1, -0.95, 0.1}});
    test::append_box(m, {0.2, 0.2, 1.1}, {{}, {-0.5, 0.3, 0.9}});
    return m;
}

Mesh cube() {
    Mesh m;
    test::append_box(m, {2, 2, 2}, {});
    return m;
}

/// Many flat sides about the z axis, without caps' corners.
Mesh cylinder() {
    constexpr int kSides = 64;
    Mesh m;
    for (int i = 0; i < kSides; ++i) {
        const double a = 2 * kPi * i / kSides;
        for (const double z : {-1.2, 1.2}) {
            m.positions.push_back(vec_cast<float>(Vec3{std::cos(a), std::sin(a), z}));
            m.normals.push_back(vec_cast<float>(Vec3{std::cos(a), std::sin(a), 0}));
        }
    }
    for (std::uint32_t i = 0; i < kSides; ++i) {
        const std::uint32_t a = 2 * i, b = 2 * ((i + 1) % kSides);
        m.faces.push_back({a, b, b + 1}), m.faces.push_back({a, b + 1, a + 1});
    }
    return m;
}

/// One body, a camera of 72 x 72 pixels and the Sun.
class Sight {
public:
    explicit Sight(Mesh mesh) {
        scene_.sun = Sun{normalized(Vec3{0.3, -0.5, 0.8}), 1361, 0};
        scene_.ambient = {8, 8, 8};
        Material grey;
        grey.diffuse = {0.3F, 0.3F, 0.3F};
        scene_.materials.push_back(grey);
        mesh.name = "target";
        mesh.face_material.assign(mesh.faces.size(), 0);
        scene_.meshes.push_back(std::move(mesh));
        Body body;
        body.name = "target";
        body.shape = 0;
        scene_.bodies.push_back(std::move(body));
        test::set_pinhole(camera_, 115, 115, test::pinhole_of(camera_).cx, test::pinhole_of(camera_).cy);
        camera_.format = PixelFormat::y16;
        render_scene_.emplace(*RenderScene::create(scene_));
        search_.emplace(*render_scene_, camera_, 0);
    }
    Sight(const Sight&) = delete;
    Sight& operator=(const Sight&) = delete;

    /// The Sun stands behind the camera's right shoulder.
    static Rigid3 T_world_camera() {
        const Vec3 z = normalized(Vec3{-0.7, 0.1, -0.7}), x = normalized(cross(Vec3{0, 1, 0}, z));
        return {quat_from_columns(x, cross(z, x), z), {3, 2, 1}};
    }
    /// A frame of the target at this pose; without one, of the dark.
    MeasuredImage frame(const std::optional<Rigid3>& T_camera_target) {
        BodyPoses at(1);
        const Rigid3 T = T_camera_target.value_or(Rigid3{{}, {0, 0, -1000}});
        at.set(0, T_world_camera() * T);
        ModelView view(*render_scene_, camera_, 0, at);
        FrameSettings s;
        s.spp = 64, s.seed = 5;
        view.render(T, s, true);
        variance_.clear();
        const auto k = sensor_model(camera_).dn_per_radiance;
        for (const float v : view.aovs().variance)
            variance_.push_back(v * static_cast<float>(std::pow(k[0] + k[1] + k[2], 2)));
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns}));
        expose(camera_, view.radiance(), 3, 0, bytes);
        return *measured_image(camera_, bytes);
    }
    static SearchOptions options(double range_m) {
        SearchOptions o;
        o.range_m = range_m;
        o.dense.samples_per_pixel = 12, o.dense.fineness = 4;
        return o;
    }
    Result<SearchEstimate> find(const MeasuredImage& image, const SearchOptions& o) {
        return search_->find(image, BodyPoses(1), T_world_camera(), o, variance_);
    }
    const Camera& camera() const { return camera_; }
    const RenderScene& render_scene() const { return *render_scene_; }

private:
    Scene scene_;
    Camera camera_ = test::square_camera(72);
    std::optional<RenderScene> render_scene_;
    std::optional<PoseSearch> search_;
    std::vector<float> variance_;
};

Rigid3 random_pose(std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> range_m(7, 13);
    const double w = normal(random), x = normal(random), y = normal(random), z = normal(random);
    return {normalized(Quat{w, x, y, z}), range_m(random) * normalized(Vec3{0.03, -0.04, 1})};
}

TEST(AttitudeGrid, LeavesNoAttitudeFar) {
    const std::vector<Quat> grid = attitude_grid(4400);
    ASSERT_EQ(grid.size(), 4400u);
    for (const Quat& q : grid) ASSERT_NEAR(norm(q), 1, 1e-12);
    std::mt19937_64 random(4);
    for (int i = 0; i < 500; ++i) {
        const Quat q = random_pose(random).q;
        double nearest = kPi;
        for (const Quat& there : grid) nearest = std::min(nearest, angle_between(q, there));
        EXPECT_LT(nearest, 15 * kDegree);
    }
}

TEST(PoseSearch, FindsACraftAtAnyAttitude) {
    Sight sight(small_craft());
    std::mt19937_64 random(11);
    int found = 0;
    for (const double range_error : {0.75, 1.0, 1.28, 0.9}) {
        const Rigid3 truth = random_pose(random);
        const auto e = sight.find(sight.frame(truth), Sight::options(range_error * norm(truth.t)));
        ASSERT_TRUE(e) << e.error().text();
        if (e->answer.kind != AnswerKind::good) continue;
        ++found;
        const Vector6 error = error_between(e->T_camera_target, truth);
        EXPECT_LT(normalised_error_squared(error, e->covariance), 50);
        EXPECT_LT(error.head<3>().norm(), 1 * kDegree);
        EXPECT_LT(error.tail<3>().norm(), 0.01 * norm(truth.t));
    }
    EXPECT_GE(found, 3);
}

TEST(PoseSearch, ASymmetricTargetIsNeverGood) {
    std::mt19937_64 random(2);
    for (const auto make : {cube, cylinder}) {
        Sight sight(make());
        const Rigid3 truth = random_pose(random);
        const auto e = sight.find(sight.frame(truth), Sight::options(1.1 * norm(truth.t)));
        ASSERT_TRUE(e) << e.error().text();
        EXPECT_NE(e->answer.kind, AnswerKind::good);
        if (make == cube) {
            EXPECT_EQ(e->answer.kind, AnswerKind::ambiguous) << e->answer.why;
            EXPECT_FALSE(e->answer.rivals.empty());
        }
    }
}

TEST(PoseSearch, RefusesTheDarkAndAnotherTarget) {
    Sight sight(small_craft());
    const MeasuredImage dark = sight.frame({});
    const auto nothing = sight.find(dark, Sight::options(10));
    ASSERT_TRUE(nothing) << nothing.error().text();
    EXPECT_EQ(nothing->answer.kind, AnswerKind::refused);
    EXPECT_NE(nothing->answer.why.find("stand out"), std::string::npos) << nothing->answer.why;

    Sight other(cube());
    std::mt19937_64 random(5);
    const MeasuredImage of_the_cube = other.frame(random_pose(random));
    (void)sight.frame(random_pose(random));  // for the variance of a frame with a target in it
    const auto wrong = sight.find(of_the_cube, Sight::options(10));
    ASSERT_TRUE(wrong) << wrong.error().text();
    EXPECT_EQ(wrong->answer.kind, AnswerKind::refused);
}

TEST(PoseSearch, RefusesARangeBeyondItsLimits) {
    Sight sight(small_craft());
    std::mt19937_64 random(11);
    const Rigid3 truth = random_pose(random);
    const auto e = sight.find(sight.frame(truth), Sight::options(0.45 * norm(truth.t)));
    ASSERT_TRUE(e) << e.error().text();
    EXPECT_EQ(e->answer.kind, AnswerKind::refused) << norm(e->T_camera_target.t) << " of " << norm(truth.t) << " m";
}

TEST(PoseSearch, IsTheSameOnAnyNumberOfThreads) {
    std::mt19937_64 random(11);
    const Rigid3 truth = random_pose(random);
    const auto on = [&](int threads) {
        tbb::task_arena arena(threads);
        return arena.execute([&] {
            Sight sight(small_craft());
            SearchOptions o = Sight::options(norm(truth.t));
            o.attitudes = 1000, o.kept = 8, o.finished = 2;
            const auto e = sight.find(sight.frame(truth), o);
            EXPECT_TRUE(e);
            return e ? *e : SearchEstimate{};
        });
    };
    const SearchEstimate one = on(1), three = on(3);
    EXPECT_EQ(one.T_camera_target, three.T_camera_target);
    EXPECT_EQ(one.covariance, three.covariance);
    EXPECT_EQ(one.answer.kind, three.answer.kind);
}

TEST(PoseSearch, BadInputIsAnError) {
    Sight sight(small_craft());
    const MeasuredImage frame = sight.frame({});
    PoseSearch search(sight.render_scene(), sight.camera(), 0);
    const auto error = [&](const SearchOptions& o, const Rigid3& T_world_camera, const MeasuredImage& image) {
        const auto e = search.find(image, BodyPoses(1), T_world_camera, o);
        return e ? std::string() : e.error().what;
    };
    const auto says = [](const std::string& text, const char* what) {
        return text.find(what) != std::string::npos;
    };
    SearchOptions o = Sight::options(0);
    EXPECT_TRUE(says(error(o, {}, frame), "range_m = 0"));
    o = Sight::options(10);
    o.range_part = 1;
    EXPECT_TRUE(says(error(o, {}, frame), "range_part = 1"));
    o = Sight::options(10);
    o.attitudes = 0;
    EXPECT_TRUE(says(error(o, {}, frame), "attitudes"));
    o = Sight::options(10);
    EXPECT_TRUE(says(error(o, {{0, 0, 0, 0}, {}}, frame), "camera's pose"));
    EXPECT_TRUE(says(error(o, {}, MeasuredImage{3, 3, std::vector<float>(9)}), "3 x 3"));
}

/// Where the light is known in the camera's axes the derivative holds what shading changes by: against the
/// difference of two images, one of them with the target turned.
TEST(DenseLight, OfTheCamerasAxesTurnsWithThePose) {
    Sight sight(small_craft());
    std::mt19937_64 random(8);
    const Rigid3 truth = random_pose(random), T_world_camera = Sight::T_world_camera();
    const SensorModel sensor = sensor_model(sight.camera());
    const Window all{0, 0, sight.camera().width, sight.camera().height};
    LevelView view(sight.render_scene(), sight.camera(), sensor, 1, all, 0, BodyPoses(1));
    FrameSettings s;
    s.spp = 64;
    const auto relative_error = [&](bool light_of_camera, int axis) {
        const double half = 0.01;
        const auto image = [&](double side) {
            BodyPoses at(1);
            const Rigid3 there = displaced(truth, side * half * Vector6::Unit(axis));
            at.set(0, T_world_camera * there);
            view.begin_frame(at, {}, {}, {}, {});
            view.render(there, s);
            const auto signal = view.images().signal;
            return std::vector<float>(signal.begin(), signal.end());
        };
        const std::vector<float> ahead = image(1), behind = image(-1);
        BodyPoses at(1);
        at.set(0, T_world_camera * truth);
        view.begin_frame(at, {}, {}, {}, light_of_camera ? std::optional(T_world_camera) : std::nullopt);
        view.render(truth, s);
        view.differentiate(truth, s, 8);
        double error2 = 0, size2 = 0;
        for (std::size_t p = 0; p < ahead.size(); ++p) {
            const double difference = static_cast<double>(ahead[p] - behind[p]);
            error2 += std::pow(difference - 2 * half * static_cast<double>(view.images().derivative[p][axis]), 2);
            size2 += difference * difference;
        }
        return std::sqrt(error2 / size2);
    };
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_LT(relative_error(true, axis), 0.3) << axis;
        EXPECT_LT(relative_error(true, axis), relative_error(false, axis)) << axis;
    }
}

}  // namespace
}  // namespace narpa
