// Sparse stereo on pictures of a tilted plane, computed here: matches and covariances against the exact geometry.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "estimator/pose/pose_estimate.h"
#include "estimator/stereo/stereo_matcher.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kSize = 240;
constexpr double kFocal_px = 600;

Camera stereo_camera() {
    Camera c;
    c.width = c.height = kSize;
    test::set_pinhole(c, kFocal_px, kFocal_px, (kSize - 1) / 2.0, (kSize - 1) / 2.0);
    c.format = PixelFormat::y16;
    Detector d;
    d.read_noise_e = 13, d.full_well_e = 13500, d.black_level_dn = 64, d.bits = 12, d.shot_noise = true;
    c.detector = d;
    return c;
}

/// z = 100 + a x + b y in the left camera's frame, m; a pixel of the left camera sees about 17 cm of it.
struct Plane {
    double a = 0.2, b = -0.1;
    [[nodiscard]] Vector3d met(const Vector3d& origin, const Vector3d& direction) const {
        const Vector3d n(-a, -b, 1);
        return origin + (100 - n.dot(origin)) / n.dot(direction) * direction;
    }
};

/// DN at a place of the plane, m.
using Paint = std::function<double(double, double)>;

/// Waves of 0.8 m and more in all directions: nothing is finer than 4.8 pixels.
Paint waves() {
    struct Wave {
        double kx, ky, phase, amplitude;
    };
    std::vector<Wave> all;
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int i = 0; i < 60; ++i) {
        const double turn = 2 * std::numbers::pi * uniform(random),
                     k = 2 * std::numbers::pi / (0.8 + 4 * uniform(random));
        all.push_back({k * std::cos(turn), k * std::sin(turn), 10 * uniform(random), 60});
    }
    return [all](double x, double y) {
        double dn = 1800;
        for (const Wave& w : all) dn += w.amplitude * std::sin(w.kx * x + w.ky * y + w.phase);
        return dn;
    };
}

MeasuredImage picture(const Camera& c, const Rigid3& T_left_camera, const Plane& plane, const Paint& paint) {
    MeasuredImage image{c.width, c.height, {}};
    for (int v = 0; v < c.height; ++v)
        for (int u = 0; u < c.width; ++u) {
            const Vec3 direction =
                T_left_camera.q * c.model->direction({static_cast<double>(u), static_cast<double>(v)});
            const Vector3d p = plane.met(to_eigen(T_left_camera.t), to_eigen(direction));
            image.dn.push_back(static_cast<float>(paint(p.x(), p.y())));
        }
    return image;
}

void add_noise(const Camera& c, std::uint64_t seed, MeasuredImage& image) {
    const SensorModel sensor = sensor_model(c);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    for (float& dn : image.dn)
        dn = static_cast<float>(std::round(dn + normal(random) * std::sqrt(sensor.variance_dn2(dn))));
}

struct Views {
    StereoPair pair;
    MeasuredImage left, right;
};
Views views(const Rigid3& T_right_left, const Paint& paint, const Plane& plane = {},
            const Camera& c = stereo_camera()) {
    return {{c, c, T_right_left}, picture(c, {}, plane, paint), picture(c, inverse(T_right_left), plane, paint)};
}

StereoSettings settings() {
    StereoSettings s;
    s.nearest_m = 60, s.farthest_m = 200;
    return s;
}

Vector3d truth(const Camera& c, const Plane& plane, const Vector2d& px) {
    return plane.met(Vector3d::Zero(), to_eigen(c.model->on_plane({px.x(), px.y()})));
}
Vector2d right_px(const StereoPair& pair, const Vector3d& point) {
    const Vec3 p = pair.T_right_left * to_vec3(point);
    const Pinhole c = test::pinhole_of(pair.right);
    return {c.fx * p.x / p.z + c.cx, c.fy * p.y / p.z + c.cy};
}

const Rigid3 kAside{{}, {-4, 0, 0}}, kAbove{{}, {0, -4, 0}}, kDown{{}, {-4, 0, -7}},
    kTurned{exp_rotation({0.03, 0.04, 0.2}), {-4, 1, -2}};

class StereoMatching : public testing::TestWithParam<Rigid3> {};

TEST_P(StereoMatching, FindsATiltedPlaneToAHundredthOfAPixel) {
    const Views v = views(GetParam(), waves());
    const auto found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found) << found.error().what;
    ASSERT_GE(found->points.size(), 60u);
    double worst = 0;
    for (const StereoPoint& p : found->points) {
        const Vector2d exact = right_px(v.pair, truth(v.pair.left, {}, p.left_px));
        EXPECT_LT((p.whole.px - exact).lpNorm<Eigen::Infinity>(), 1) << p.left_px.transpose();
        worst = std::max(worst, (p.match.px - exact).norm());
    }
    EXPECT_LT(worst, 0.01);
}

TEST_P(StereoMatching, ErrorsHaveTheCovariance) {
    Views v = views(GetParam(), waves());
    double along = 0, across = 0;
    int n = 0;
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
        MeasuredImage left = v.left, right = v.right;
        add_noise(v.pair.left, 2 * seed, left), add_noise(v.pair.right, 2 * seed + 1, right);
        const auto found = match_stereo(v.pair, left, right, settings());
        ASSERT_TRUE(found);
        for (const StereoPoint& p : found->points) {
            const double e = p.point.point_m.z() - truth(v.pair.left, {}, p.left_px).z();
            along += e * e / p.point.covariance_m2(2, 2);
            across += p.point.epipolar_sigmas * p.point.epipolar_sigmas;
            ++n;
        }
    }
    ASSERT_GE(n, 120);
    // A plane has neither the relief nor the detail beyond its pixels that the covariance allows for beside the
    // noise, so it is too large here, by less than a factor of two in deviation.
    const double statistics = 3 * std::sqrt(2.0 / n);
    for (const double ratio : {along / n, across / n}) {
        EXPECT_LT(ratio, 1 + statistics);
        EXPECT_GT(ratio, 0.25);
    }
}
std::string name_of(const testing::TestParamInfo<Rigid3>& at) {
    return std::array<const char*, 4>{"aside", "above", "down", "turned"}[at.index];
}
INSTANTIATE_TEST_SUITE_P(Baselines, StereoMatching, testing::Values(kAside, kAbove, kDown, kTurned), name_of);

TEST(StereoMatcher, MatchesThroughLensesThatDistort) {
    Camera barrel = stereo_camera();
    barrel.model = test::brown_conrady(test::pinhole_of(barrel), {-0.8, 0.4, 2e-3, -1e-3});
    Views v = views(kTurned, waves(), {}, barrel);
    add_noise(barrel, 1, v.left), add_noise(barrel, 2, v.right);
    const auto found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found) << found.error().text();
    const double n = static_cast<double>(found->points.size());
    ASSERT_GE(n, 60);
    double along = 0, across = 0;
    for (const StereoPoint& p : found->points) {
        const double e = p.point.point_m.z() - truth(barrel, {}, p.left_px).z();
        along += e * e / p.point.covariance_m2(2, 2) / n;
        across += p.point.epipolar_sigmas * p.point.epipolar_sigmas / n;
    }
    for (const double ratio : {along, across}) {
        EXPECT_LT(ratio, 2);  // resampling correlates the noise of neighbours, which the covariance does not know
        EXPECT_GT(ratio, 0.25);
    }
    for (Camera* c : {&v.pair.left, &v.pair.right})
        c->model = std::make_shared<const Pinhole>(test::pinhole_of(*c));
    const auto ignored = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(ignored);
    EXPECT_LT(ignored->points.size(), found->points.size() / 2);
}

TEST(StereoMatcher, RefusesRepeatedPatterns) {
    // A pattern of 1 m each way: six pixels, of which the line crosses twenty.
    const double k = 2 * std::numbers::pi;
    const Views v =
        views(kAside, [=](double x, double y) { return 1800 + 700 * std::sin(k * x) * std::sin(k * y); }, {0, 0});
    const auto found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found);
    // Where the second of the places it may have, 18 px to the left, would be cut off, there is no telling.
    for (const StereoPoint& p : found->points) EXPECT_LT(p.left_px.x(), 18 + settings().patch_radius_px + 3);
    EXPECT_GT(found->counts.ambiguous, 20);
}

TEST(StereoMatcher, FindsNothingInOtherImages) {
    Views v = views(kAside, waves());
    v.right = views(kAside, [other = waves()](double x, double y) { return other(50 - y, x); }).right;
    const auto found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found);
    EXPECT_LE(found->counts.accepted, 2);
    EXPECT_GT(found->counts.unlike, 100);
}

TEST(StereoMatcher, FindsNothingInNoiseOrInSaturatedImages) {
    Views v = views(kAside, [](double, double) { return 1800; });
    add_noise(v.pair.left, 1, v.left), add_noise(v.pair.right, 2, v.right);
    auto found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found);
    EXPECT_EQ(found->counts.accepted, 0);

    v = views(kAside, waves());
    const auto top = static_cast<float>(sensor_model(v.pair.left).top_dn);
    for (float& dn : v.left.dn) dn = std::min(2.5f * dn, top);
    found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found);
    EXPECT_EQ(found->counts.accepted, 0);
    EXPECT_GT(found->counts.cut_off, 50);
}

TEST(StereoMatcher, UnexplainedResidualsWidenTheCovariance) {
    // The right frame is three times as noisy as its detector is.
    Views v = views(kDown, waves());
    add_noise(v.pair.left, 1, v.left);
    for (std::uint64_t seed = 2; seed < 11; ++seed) add_noise(v.pair.right, seed, v.right);
    const auto found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found);
    const auto n = static_cast<double>(found->points.size());
    ASSERT_GE(n, 60);
    double misfit = 0, squared = 0;
    for (const StereoPoint& p : found->points) {
        const double e = p.point.point_m.z() - truth(v.pair.left, {}, p.left_px).z();
        misfit += p.match.misfit / n;
        squared += e * e / p.point.covariance_m2(2, 2) / n;
    }
    EXPECT_GT(misfit, 2);
    EXPECT_NEAR(squared, 1, 3 * std::sqrt(2 / n));
}

TEST(StereoMatcher, GainAndOffsetDoNotMatter) {
    Views v = views(kDown, waves());
    for (float& dn : v.right.dn) dn = 0.6f * dn + 200;
    const auto found = match_stereo(v.pair, v.left, v.right, settings());
    ASSERT_TRUE(found);
    ASSERT_GE(found->points.size(), 60u);
    for (const StereoPoint& p : found->points)
        EXPECT_LT((p.match.px - right_px(v.pair, truth(v.pair.left, {}, p.left_px))).norm(), 0.01);
}

TEST(StereoMatcher, BadInputIsReported) {
    const Views good = views(kAside, waves());
    const auto error = [](const Views& v, const StereoSettings& s) {
        const auto found = match_stereo(v.pair, v.left, v.right, s);
        return found ? std::string() : found.error().what;
    };
    EXPECT_EQ(error(good, settings()), "");
    Views v = good;
    v.right.width = 100;
    EXPECT_EQ(error(v, settings()), "the right frame is of 100 x 240 pixels, expected the camera's 240 x 240");
    v = good, v.left.dn[7] = std::nanf("");
    EXPECT_NE(error(v, settings()).find("the left frame has pixels that are not finite"), std::string::npos);
    v = good, v.pair.T_right_left.t = {};
    EXPECT_NE(error(v, settings()).find("without a baseline"), std::string::npos);
    v = good, v.pair.T_right_left.t.x = std::nan("");
    EXPECT_NE(error(v, settings()).find("expected finite numbers"), std::string::npos);
    StereoSettings s = settings();
    s.nearest_m = 0;
    EXPECT_NE(error(good, s).find("expected 0 < nearest < farthest"), std::string::npos);
    s = settings(), s.farthest_m = std::nan("");
    EXPECT_NE(error(good, s).find("expected 0 < nearest < farthest"), std::string::npos);
    s = settings(), s.patch_radius_px = 0;
    EXPECT_NE(error(good, s).find("expected a patch radius"), std::string::npos);
}

TEST(StereoMatcher, SurvivesLinesThatPassTheOtherCamera) {
    // The right camera stands among the depths that are looked at: lines run to its epipole, or out of any frame.
    const Views v = views(kDown, waves());
    for (const Rigid3& T :
         {Rigid3{{}, {0, 0, -70}}, Rigid3{{}, {3, 0, -90}}, Rigid3{exp_rotation({0, 3, 0}), {1, 0, 0}}}) {
        StereoSettings s = settings();
        s.nearest_m = 1e-3, s.farthest_m = 1e9;
        EXPECT_TRUE(match_stereo({v.pair.left, v.pair.right, T}, v.left, v.right, s));
    }
}

TEST(SplineImage, PassesThroughThePixelsWithItsSlope) {
    MeasuredImage image{40, 32, {}};
    std::mt19937_64 random(9);
    std::uniform_real_distribution<float> uniform(0, 4000);
    for (int i = 0; i < image.width * image.height; ++i) image.dn.push_back(uniform(random));
    const SplineImage spline(image);
    for (int y = 2; y < 28; ++y)
        for (int x = 2; x < 36; ++x) EXPECT_NEAR(spline.sample({x, y}).dn, image.at(x, y), 1e-8);
    std::uniform_real_distribution<double> u(2, 36), v(2, 28);
    constexpr double kStep = 1e-5;
    for (int i = 0; i < 200; ++i) {
        const Vector2d at(u(random), v(random));
        const auto s = spline.sample(at);
        for (int axis = 0; axis < 2; ++axis) {
            const Vector2d step = kStep * Vector2d::Unit(axis);
            EXPECT_NEAR(s.gradient[axis], (spline.sample(at + step).dn - spline.sample(at - step).dn) / (2 * kStep),
                        0.05);
        }
    }
}

TEST(EpipolarWarp, FollowsThePointAlongTheLine) {
    const Pinhole from = test::pinhole_of(stereo_camera()), to{500, 550, 100, from.cy};
    const EpipolarWarp warp(from, to, kTurned);
    const Vector2d left(30, 190);
    const Vector3d ray = warp.ray(left);
    for (const double depth : {20.0, 100.0, 1e4}) {
        const Vec3 p = kTurned * (depth * Vec3{(30 - from.cx) / from.fx, (190 - from.cy) / from.fy, 1});
        const Vector2d px(to.fx * p.x / p.z + to.cx, to.fy * p.y / p.z + to.cy);
        EXPECT_LT((warp.px(ray, 1 / depth) - px).norm(), 1e-10);
        EXPECT_NEAR(warp.inverse_depth_there(ray, 1 / depth), 1 / p.z, 1e-12);
        for (int axis = 0; axis < 2; ++axis)
            EXPECT_NEAR(warp.inverse_depth_at(ray, axis, px[axis]), 1 / depth, 1e-12);
        constexpr double kStep = 1e-7;
        const Vector2d slope = (warp.px(ray, 1 / depth + kStep) - warp.px(ray, 1 / depth - kStep)) / (2 * kStep);
        EXPECT_LT((warp.px_slope(ray, 1 / depth) - slope).norm(), 1e-5 * slope.norm());
    }
}

}  // namespace
}  // namespace narpa
