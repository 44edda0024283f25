#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "dataset/image/image_random.h"
#include "tests/dataset/dataset_support.h"

namespace narpa::test {
namespace {

using dataset::draw_image;
using dataset::ImageDraw;
using dataset::ImageRandom;
using dataset::Purpose;

constexpr std::uint32_t kDraws = 4000;

/// The largest distance of an empirical distribution function from that of uniform numbers (Kolmogorov, Smirnov),
/// times the root of their number: above 1.95 in one of a thousand samples.
double kolmogorov_smirnov(std::vector<double> uniform) {
    std::ranges::sort(uniform);
    const auto n = static_cast<double>(uniform.size());
    double largest = 0;
    for (std::size_t i = 0; i < uniform.size(); ++i)
        largest = std::max({largest, std::abs(uniform[i] - static_cast<double>(i) / n),
                            std::abs(uniform[i] - static_cast<double>(i + 1) / n)});
    return largest * std::sqrt(n);
}
constexpr double kRare = 1.95;

TEST(ImageRandomNumbers, AreUniformInEachPurposeAndIndex) {
    for (const Purpose purpose : {Purpose::range, Purpose::attitude, Purpose::backdrop_pose})
        for (const std::size_t index : {0u, 1u, 2u, 31u}) {
            std::vector<double> u;
            for (std::uint32_t i = 0; i < kDraws; ++i) u.push_back(ImageRandom(3, i).uniform(purpose, index));
            EXPECT_LT(kolmogorov_smirnov(u), kRare) << index;
        }
}

TEST(ImageRandomNumbers, DifferByImageSeedPurposeAndIndex) {
    const double u = ImageRandom(3, 5).uniform(Purpose::range, 0);
    EXPECT_EQ(u, ImageRandom(3, 5).uniform(Purpose::range, 0));
    EXPECT_NE(u, ImageRandom(3, 6).uniform(Purpose::range, 0));
    EXPECT_NE(u, ImageRandom(4, 5).uniform(Purpose::range, 0));
    EXPECT_NE(u, ImageRandom(3, 5).uniform(Purpose::place, 0));
    EXPECT_NE(u, ImageRandom(3, 5).uniform(Purpose::range, 1));
}

TEST(Attitudes, AreUniformOverAllRotations) {
    // Of a uniform rotation each axis is uniform on the sphere, and the angle a has the distribution (a - sin a) /
    // pi.
    std::vector<double> z_of_x, z_of_z, angle;
    for (std::uint32_t i = 0; i < kDraws; ++i) {
        const ImageRandom r(11, i);
        const Quat q = dataset::uniform_attitude(r.uniform(Purpose::attitude, 0), r.uniform(Purpose::attitude, 1),
                                                 r.uniform(Purpose::attitude, 2));
        z_of_x.push_back(0.5 * (1 + (q * Vec3{1, 0, 0}).z));
        z_of_z.push_back(0.5 * (1 + (q * Vec3{0, 0, 1}).z));
        const double a = angle_between(q, Quat{});
        angle.push_back((a - std::sin(a)) / kPi);
    }
    EXPECT_LT(kolmogorov_smirnov(z_of_x), kRare);
    EXPECT_LT(kolmogorov_smirnov(z_of_z), kRare);
    EXPECT_LT(kolmogorov_smirnov(angle), kRare);
}

TEST(Attitudes, ShortestRotationTurnsOneVectorToTheOther) {
    const std::array<Vec3, 5> directions{
        {{1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, normalized(Vec3{1, 2, 3}), normalized(Vec3{-1, -2, -3.0000001})}};
    for (const Vec3& from : directions)
        for (const Vec3& to : directions) EXPECT_LT(norm(dataset::shortest_rotation(from, to) * from - to), 1e-7);
}

using Draws = DatasetTest;

TEST_F(Draws, AreThoseOfTheRecipe) {
    const auto set = scenes(R"([pose]
range_m = {kind = "log_uniform", between = [3.0, 30.0]}
margin = 0.2
[illumination]
phase_deg = {between = [20.0, 90.0]}
[exposure]
time_factor = {between = [0.5, 2.0]}
)");
    const Camera& camera = set->camera();
    const Vec3 sun = *set->facts().sun_world;
    std::vector<double> range, x, y, phase, factor, azimuth;
    for (std::uint32_t i = 0; i < kDraws; ++i) {
        const ImageDraw d = draw_image(set->recipe(), set->facts(), i);
        EXPECT_EQ(d.variant + d.backdrop, 0u);
        const Vec3 point = d.T_camera_target * set->facts().point_m;
        range.push_back(std::log(norm(point) / 3) / std::log(10.0));
        const auto px = camera.model->project(point);
        x.push_back((px->x + 0.5 - 0.2 * 64) / (0.6 * 64));
        y.push_back((px->y + 0.5 - 0.2 * 48) / (0.6 * 48));
        const double angle = std::acos(dot(-normalized(point), *d.sun_camera));
        EXPECT_NEAR(angle, d.phase_rad, 1e-7);
        phase.push_back((kDegPerRad * angle - 20) / 70);
        factor.push_back((d.time_factor - 0.5) / 1.5);
        EXPECT_LT(norm(d.q_world_camera * *d.sun_camera - sun), 1e-12);
    }
    for (const auto* u : {&range, &x, &y, &phase, &factor}) EXPECT_LT(kolmogorov_smirnov(*u), kRare);
}

TEST_F(Draws, WithoutAPhaseAngleHaveTheSunAnywhere) {
    const auto set = scenes("");
    std::vector<double> cosine;
    for (std::uint32_t i = 0; i < kDraws; ++i)
        cosine.push_back(0.5 * (1 + std::cos(draw_image(set->recipe(), set->facts(), i).phase_rad)));
    EXPECT_LT(kolmogorov_smirnov(cosine), kRare);
}

TEST_F(Draws, OfAConeSeeTheTargetFromWithinIt) {
    const auto set = scenes(R"([pose]
attitude = {kind = "cone", axis = [0.0, 1.0, 0.0], half_angle_deg = 25.0, up = [0.0, 0.0, 1.0]}
)");
    const double edge = std::cos(25 * kRadPerDeg);
    std::vector<double> solid;
    for (std::uint32_t i = 0; i < kDraws; ++i) {
        const ImageDraw d = draw_image(set->recipe(), set->facts(), i);
        const Vec3 point = d.T_camera_target * set->facts().point_m;
        const Vec3 to_camera = conjugate(d.T_camera_target.q) * -normalized(point);
        const double cosine = dot(to_camera, Vec3{0, 1, 0});
        ASSERT_GT(cosine, edge - 1e-9);
        solid.push_back((1 - cosine) / (1 - edge));
        // Seen along the line of sight, the target's up is up in the image: no roll.
        const Vec3 up =
            dataset::shortest_rotation(normalized(point), {0, 0, 1}) * (d.T_camera_target.q * Vec3{0, 0, 1});
        EXPECT_LT(std::abs(up.x), 1e-9);
        EXPECT_LT(up.y, 0);
    }
    EXPECT_LT(kolmogorov_smirnov(solid), kRare);
}

TEST_F(Draws, DivideImagesByWeights) {
    const auto set = scenes(R"([[variant]]
name = "a"
[[variant]]
name = "b"
weight = 3.0
[[background]]
kind = "none"
[[background]]
kind = "scene"
)");
    int second = 0, scene = 0, both = 0;
    for (std::uint32_t i = 0; i < kDraws; ++i) {
        const ImageDraw d = draw_image(set->recipe(), set->facts(), i);
        second += static_cast<int>(d.variant), scene += static_cast<int>(d.backdrop);
        both += static_cast<int>(d.variant * d.backdrop);
    }
    EXPECT_NEAR(second, 0.75 * kDraws, 120);
    EXPECT_NEAR(scene, 0.5 * kDraws, 130);
    EXPECT_NEAR(both, 0.375 * kDraws, 130);
}

TEST_F(Draws, PlaceABodyBehindTheTarget) {
    const auto set = scenes("attached = [\"wall\"]\n[[background]]\nkind = \"body\"\nbody = \"moon\"\n");
    const auto scene = *set->shared(0, 0);
    ASSERT_EQ(scene->scene().bodies.size(), 4u);
    const double distance_m = norm(Vec3{0, 1000, 0} - Vec3{5, 2, -3});
    for (std::uint32_t i = 0; i < 200; ++i) {
        const ImageDraw d = draw_image(set->recipe(), set->facts(), i);
        const auto p = scene->place(d);
        const Vec3 target = p.T_world_body[1].t, moon = p.T_world_body[3].t;
        EXPECT_LT(norm(target - Vec3{5, 2, -3}), 1e-9);
        EXPECT_NEAR(norm(moon - target), distance_m, 1e-9);
        const Vec3 line = normalized(target - p.T_world_camera.t);
        const double from_line_m = norm(cross(moon - p.T_world_camera.t, line));
        EXPECT_LT(from_line_m, 101) << "the line of sight through the target meets the moon";
        EXPECT_GT(dot(moon - target, line), 900);
        // What is attached keeps its pose relative to the target; the craft keeps its own relative to the camera.
        EXPECT_LT(norm(inverse(p.T_world_body[1]) * p.T_world_body[2].t - Vec3{3, 0, 0}), 1e-9);
        EXPECT_LT(norm(inverse(p.T_world_body[0]) * p.T_world_camera.t - Vec3{0.03, 0, 0.05}), 1e-9);
    }
}

TEST_F(Draws, RemoveOtherBodiesFromABlackBackground) {
    const auto set = scenes("target = \"wall\"\n[[background]]\nkind = \"none\"\n");
    const auto scene = *set->shared(0, 0);
    ASSERT_EQ(scene->scene().bodies.size(), 2u);
    EXPECT_EQ(scene->scene().bodies[0].name, "chaser");
    EXPECT_EQ(scene->scene().bodies[1].name, "wall");
    EXPECT_EQ(scene->body_ids(), (std::vector<int>{1, 3}));
    EXPECT_EQ(scene->roles().target, 1u);
    EXPECT_EQ(scene->roles().mount, 0);
}

}  // namespace
}  // namespace narpa::test
