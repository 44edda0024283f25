// The pose in a LiDAR's sweep without a guess.
#include "estimator/search/cloud_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/shapes.h"

namespace narpa {
namespace {

constexpr RangeNoise kSweepNoise{0.02, 5.1e-5};
const ApparentMotion kDrift{{0.05, -0.02, 0.04}, {0.01, 0.005, -0.015}};

void add_box(Mesh& m, const Vec3& size_m, const Rigid3& T) {
    const auto first = static_cast<std::uint32_t>(m.positions.size());
    const Mesh part = test::box(size_m.x, size_m.y, size_m.z);
    for (const Vec3f& p : part.positions) m.positions.push_back(vec_cast<float>(T * vec_cast<double>(p)));
    for (const auto& f : part.faces) m.faces.push_back({first + f[0], first + f[1], first + f[2]});
    m.face_material.assign(m.faces.size(), 0);
}

/// A bus with two unlike panels and a mast.
Mesh satellite() {
    Mesh m = test::box(1.5, 1, 1);
    add_box(m, {0.75, 1.7, 0.05}, {exp_rotation({0, 0.4, 0}), {0.15, 1.4, 0}});
    add_box(m, {0.75, 1.2, 0.05}, {exp_rotation({0, -0.3, 0}), {-0.1, -1.1, 0.1}});
    add_box(m, {0.15, 0.15, 1.2}, {{}, {-0.5, 0.3, 0.9}});
    return m;
}

struct SearchedBody {
    Scene scene;
    Tracer tracer;
    explicit SearchedBody(Mesh mesh) : scene(of(std::move(mesh))), tracer(*Tracer::create(scene, 1)) {}
    static Scene of(Mesh mesh) {
        Scene s;
        s.materials.push_back(test::lambert(0.3F));
        test::add_mesh(s, std::move(mesh));
        return s;
    }
    /// 61 x 31 beams, 0.5 and 1 degrees apart.
    [[nodiscard]] LidarSweep sweep(const Rigid3& T, std::mt19937_64& random) const {
        std::normal_distribution<double> noise(0, kSweepNoise.range_m);
        LidarSweep out;
        BodyPoses at(1);
        for (int line = -15; line <= 15; ++line)
            for (int column = -30; column <= 30; ++column) {
                const double a = 0.5 * kRadPerDeg * column, w = kRadPerDeg * line, t_s = 1e-4 * column;
                const Vec3 beam{std::cos(w) * std::sin(a), std::cos(w) * std::cos(a), std::sin(w)};
                at.set(0, moved(T, kDrift, t_s));
                if (const Hit hit = tracer.intersect(at, {{}, beam}, 200); hit.body >= 0)
                    out.points.push_back({{}, beam, hit.range_m + noise(random), t_s});
                else
                    out.empty.push_back({{}, beam, t_s});
            }
        return out;
    }
    [[nodiscard]] Result<CloudEstimate> find(const LidarSweep& sweep, const CloudSearchOptions& o = {}) const {
        CloudSearch search(tracer, 0, {.noise = kSweepNoise, .certain = {0, 50, 0}});
        return search.find(sweep.points, kDrift, sweep.empty, o);
    }
};

Rigid3 anywhere(std::mt19937_64& random) {
    std::uniform_real_distribution<double> u(-1, 1);
    return {test::random_attitude(random), {0.6 * u(random), 9 + 2 * u(random), 0.6 * u(random)}};
}

TEST(CloudSearch, FindsASatelliteInAnyAttitude) {
    const SearchedBody target(satellite());
    std::mt19937_64 random(1);
    int good = 0;
    constexpr int kSweeps = 6;
    for (int k = 0; k < kSweeps; ++k) {
        const Rigid3 truth = anywhere(random);
        const auto e = target.find(target.sweep(truth, random));
        ASSERT_TRUE(e) << e.error().text();
        if (e->answer.kind != AnswerKind::good) continue;
        ++good;
        EXPECT_LT(normalised_error_squared(error_between(e->T_lidar_target, truth), e->covariance), 50) << k;
    }
    EXPECT_GE(good, kSweeps - 1);
}

TEST(CloudSearch, ASymmetricBodyIsAmbiguous) {
    const SearchedBody brick(test::box(2.4, 1.6, 1));
    std::mt19937_64 random(2);
    for (int k = 0; k < 2; ++k) {
        const auto e = brick.find(brick.sweep(anywhere(random), random));
        ASSERT_TRUE(e) << e.error().text();
        EXPECT_EQ(e->answer.kind, AnswerKind::ambiguous) << e->answer.why;
        EXPECT_GE(e->answer.rivals.size(), 1u);
    }
}

TEST(CloudSearch, AnotherTargetIsRefused) {
    const SearchedBody seen(test::box(2.4, 1.6, 1)), believed(satellite());
    std::mt19937_64 random(3);
    for (int k = 0; k < 2; ++k) {
        const auto e = believed.find(seen.sweep(anywhere(random), random));
        EXPECT_TRUE(!e || e->answer.kind == AnswerKind::refused);
    }
}

TEST(CloudSearch, BadInputIsReported) {
    const SearchedBody target(satellite());
    std::mt19937_64 random(4);
    LidarSweep sweep = target.sweep(anywhere(random), random);
    EXPECT_NE(target.find(sweep, {.attitudes = 0}).error().text().find("at least 1"), std::string::npos);
    const auto nothing = target.find({});
    ASSERT_TRUE(nothing) << nothing.error().text();
    EXPECT_EQ(nothing->answer.kind, AnswerKind::refused);
    EXPECT_NE(nothing->answer.why.find("a pose of 0 points"), std::string::npos) << nothing->answer.why;
    sweep.points[0].range_m = -1;
    EXPECT_NE(target.find(sweep).error().text().find("point 0 of the sweep"), std::string::npos);
}

}  // namespace
}  // namespace narpa
