// The pose by lamps, reflectors and tags: where the scenes say that they are, within its covariance, or refused.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "base/constants.h"
#include "estimator/marks/blob_finder.h"
#include "estimator/marks/mark_alignment.h"
#include "estimator/marks/mark_matcher.h"
#include "estimator/marks/mark_view.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/campaign.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

/// The first body of a scene, and the scene's first camera, which may be anywhere.
class MarkedTarget {
public:
    MarkedTarget(const std::string& file, int factor) {
        auto read = read_scene(test::build_path("scenes/" + file));
        if (!read) throw std::runtime_error(read.error().text());
        scene_ = *std::move(read);
        // Vacuum around it: the other bodies are far away.
        for (std::size_t i = 1; i < scene_.bodies.size(); ++i)
            scene_.bodies[i].initial.T_world_body.t = {0, 0, 1e6};
        auto made = RenderScene::create(scene_);
        if (!made) throw std::runtime_error(made.error().text());
        render_scene_.emplace(*std::move(made));
        camera_ = factor > 1 ? coarser_camera(scene_.cameras[0], factor) : scene_.cameras[0];
        camera_.mount = -1;
        at_ = BodyPoses(scene_.bodies.size());
        for (std::size_t i = 0; i < scene_.bodies.size(); ++i) at_.set(i, scene_.bodies[i].initial.T_world_body);
    }
    [[nodiscard]] const RenderScene& render_scene() const { return *render_scene_; }
    [[nodiscard]] const Camera& camera() const { return camera_; }
    [[nodiscard]] const std::vector<Mark>& marks() const { return scene_.bodies[0].marks; }

    /// T_camera_target of a camera at this position in the body's axes with its optical axis along -x, rotated by a
    /// rotation vector in its own axes.
    [[nodiscard]] static Rigid3 seen_from(const Vec3& position_m, const Vec3& rotation_rad = {}) {
        const Quat facing{0.5, -0.5, -0.5, 0.5};  // camera x, y, z = body y, -z, -x
        return inverse(Rigid3{normalized(facing * exp_rotation(rotation_rad)), position_m});
    }
    [[nodiscard]] MeasuredImage frame(const Rigid3& T_camera_target, std::uint32_t number, int spp) const {
        ModelView view(*render_scene_, camera_, 0, at_);
        FrameSettings settings;
        settings.spp = spp, settings.seed = 77, settings.frame = number;
        view.render(T_camera_target, settings, false);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns}));
        expose(camera_, view.radiance(), 5, number, bytes);
        return *measured_image(camera_, bytes);
    }

private:
    Scene scene_;
    std::optional<RenderScene> render_scene_;
    Camera camera_;
    BodyPoses at_{0};
};

Rigid3 displaced_by(double degrees, double percent, const Rigid3& T, std::mt19937_64& random) {
    return displaced(T, random_error(degrees * kRadPerDeg, 0.01 * percent * norm(T.t), random));
}

const MarkedTarget& docking() {
    static const MarkedTarget target("docking/docking.toml", 2);
    return target;
}
const MarkedTarget& board() {
    static const MarkedTarget target("marks/marks.toml", 1);
    return target;
}

/// Spots of the image within 5 px of where the pose has each disc; -1: the disc is not in view.
std::vector<double> distances_px(const MarkedTarget& target, const Rigid3& T, const MeasuredImage& frame) {
    std::vector<double> distances;
    for (const Mark& mark : target.marks()) {
        const auto view = disc_view(mark, T, *target.camera().model);
        if (!view || view->centroid.u < 20 || view->centroid.v < 20 || view->centroid.u > frame.width - 20 ||
            view->centroid.v > frame.height - 20)
            continue;
        const auto [u, v] = view->centroid;
        const auto blobs =
            find_blobs(frame, sensor_model(target.camera()), {u - 5, v - 5, u + 5, v + 5}, view->radius_px, 3);
        double nearest = 99;
        for (const Blob& b : blobs) nearest = std::min(nearest, std::hypot(b.at.u - u, b.at.v - v));
        distances.push_back(nearest);
    }
    return distances;
}

TEST(Marks, OfTheScenesAreWhereRendersShowThem) {
    std::size_t discs = 0;
    const auto compare = [&](const MarkedTarget& target, const Rigid3& T) {
        for (const double d : distances_px(target, T, target.frame(T, 1, 32))) {
            EXPECT_LT(d, 0.1);
            ++discs;
        }
    };
    for (const double x_m : {1.2, 3.4})
        compare(docking(), MarkedTarget::seen_from({x_m, 0.06, -0.03}, {0.01, -0.02, 0.03}));
    compare(board(), MarkedTarget::seen_from({2.2, 0.1, 0.1}, {0.05, 0.05, 0.1}));
    EXPECT_GE(discs, 8u + 10 + 5);
}

TEST(Marks, CentroidOfADiscIsNotTheImageOfItsCentre) {
    Mark mark;
    mark.radius_m = 0.2;
    const Pinhole model = Pinhole(500, 500, 320, 240);
    const Quat tilted = exp_rotation({0, kPi - 0.8, 0});
    const auto view = disc_view(mark, {tilted, {0.1, 0, 1}}, model);
    ASSERT_TRUE(view);
    // By 400,000 points of the disc, weighted by the area that they cover in the image.
    double u = 0, sum = 0;
    for (int i = 0; i < 1000; ++i)
        for (int k = 0; k < 400; ++k) {
            const double r = 0.2 * (i + 0.5) / 1000, a = 2 * kPi * (k + 0.5) / 400;
            const Vec3 p = Rigid3{tilted, {0.1, 0, 1}} * Vec3{r * std::cos(a), r * std::sin(a), 0};
            const double weight = r * std::abs(dot(p, tilted * Vec3{0, 0, 1})) / (p.z * p.z * p.z);
            u += weight * model.project(p)->x, sum += weight;
        }
    EXPECT_NEAR(view->centroid.u, u / sum, 0.15);  // of a radius of 100 px
    EXPECT_GT(std::abs(view->centroid.u - view->centre.u), 2);
    // From behind it is not seen; a sphere is.
    EXPECT_FALSE(disc_view(mark, {{}, {0, 0, 1}}, model));
    mark.is_spherical = true;
    EXPECT_TRUE(disc_view(mark, {{}, {0, 0, 1}}, model));
}

struct MarkCase {
    std::string name;
    const MarkedTarget& (*target)();
    double x_m;
    int spp;
    double off, nees_low, nees_high;
};
void PrintTo(const MarkCase& c, std::ostream* out) {
    *out << c.name;
}

class MarksAt : public testing::TestWithParam<MarkCase> {};

// Poses of usable answers are as accurate as their covariance says; no good one is beyond six sigma.
TEST_P(MarksAt, GiveThePoseWithinItsCovariance) {
    const MarkCase& c = GetParam();
    const MarkAlignment alignment(c.target().render_scene(), c.target().camera(), 0);
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    const int trials = test::trials(6, 200);
    double nees = 0, rotation_rad2 = 0, position_m2 = 0;
    int usable = 0;
    for (int i = 0; i < trials; ++i) {
        const Vec3 position_m{c.x_m, 0.02 * c.x_m * normal(random), 0.02 * c.x_m * normal(random)};
        const Rigid3 T =
            MarkedTarget::seen_from(position_m, 0.03 * Vec3{normal(random), normal(random), normal(random)});
        const MarkEstimate e = alignment.align(c.target().frame(T, static_cast<std::uint32_t>(i), c.spp),
                                               displaced_by(c.off, c.off, T, random));
        if (!e.answer.usable()) continue;
        ++usable;
        const Vector6 error = error_between(e.T_camera_target, T);
        const double squared = normalised_error_squared(error, e.covariance);
        EXPECT_LT(squared, 50) << i << ": " << e.marks << " marks";
        nees += squared, rotation_rad2 += error.head<3>().squaredNorm(),
            position_m2 += error.tail<3>().squaredNorm();
    }
    RecordProperty("good_of", fmt::format("{} of {}", usable, trials));
    RecordProperty("rms",
                   fmt::format("{:.3g} deg, {:.3g} mm, NEES {:.2f}", 180 / kPi * std::sqrt(rotation_rad2 / usable),
                               1e3 * std::sqrt(position_m2 / usable), nees / usable));
    EXPECT_GE(usable, trials - 1 - trials / 20);
    EXPECT_GT(nees / usable, c.nees_low);
    EXPECT_LT(nees / usable, c.nees_high);
}
INSTANTIATE_TEST_SUITE_P(All, MarksAt,
                         testing::Values(MarkCase{"Lamps10m", docking, 10, 1, 5, 1, 9},
                                         MarkCase{"Lamps3m", docking, 3, 1, 5, 1.5, 10},
                                         MarkCase{"Lamps1m", docking, 1, 1, 5, 1.5, 9},
                                         MarkCase{"Lamps3mAveraged", docking, 3, 32, 10, 1, 10},
                                         MarkCase{"Board", board, 2.2, 8, 15, 3, 11}),
                         [](const auto& of) { return of.param.name; });

// Spots that are no marks must not give a pose.
TEST(Marks, OfATargetThatIsNotThereAreRefused) {
    const MarkAlignment alignment(docking().render_scene(), docking().camera(), 0);
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> x(3, docking().camera().width - 3), y(3, docking().camera().height - 3);
    const Rigid3 T = MarkedTarget::seen_from({4, 0, 0});
    for (int trial = 0; trial < test::trials(8, 500); ++trial) {
        MeasuredImage image{docking().camera().width, docking().camera().height, {}};
        image.dn.assign(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), 70);
        for (int spot = 0; spot < 100; ++spot) {
            const auto i = static_cast<int>(x(random)), j = static_cast<int>(y(random));
            for (const auto& [di, dj] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}})
                image.dn[image.index(i + di, j + dj)] = 3000;
        }
        const MarkEstimate e = alignment.align(image, displaced_by(3, 3, T, random));
        EXPECT_FALSE(e.answer.usable()) << trial << ": " << e.marks << " marks";
    }
}

TEST(Marks, HiddenByTheTargetAreNotUsed) {
    // Close to the port its ring hides parts of the lamps on posts; with these the pose would be wrong.
    const MarkAlignment alignment(docking().render_scene(), docking().camera(), 0);
    std::mt19937_64 random(3);
    for (const double x_m : {1.9, 2.2}) {
        const Rigid3 T = MarkedTarget::seen_from({x_m, 0.03, 0.05}, {0.05, -0.02, 0});
        const MarkEstimate e = alignment.align(docking().frame(T, 3, 64), displaced_by(5, 5, T, random));
        ASSERT_TRUE(e.answer.usable()) << x_m << " m: " << e.answer.why;
        EXPECT_LT(normalised_error_squared(error_between(e.T_camera_target, T), e.covariance), 30) << x_m;
    }
}

TEST(Marks, WithoutTheirTargetInViewSayWhatIsMissing) {
    const MarkAlignment lamps(docking().render_scene(), docking().camera(), 0);
    const Rigid3 T = MarkedTarget::seen_from({4, 0, 0});
    MeasuredImage black{docking().camera().width, docking().camera().height, {}};
    black.dn.assign(static_cast<std::size_t>(black.width) * static_cast<std::size_t>(black.height), 64);
    const MarkEstimate e = lamps.align(black, T);
    EXPECT_EQ(e.answer.kind, AnswerKind::refused);
    EXPECT_NE(e.answer.why.find("0 of 14 marks in view"), std::string::npos) << e.answer.why;
}

}  // namespace
}  // namespace narpa
