// The double-sphere model: its definition, its limits and its derivatives.
#include "renderer/projection/double_sphere.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "base/constants.h"

namespace narpa::double_sphere {
namespace {

struct Parameters {
    double xi, alpha;
};
const Pinhole kIntrinsics{158.3, 158.1, 254.96, 256.89};
/// Of fisheye lenses (the first two as Usenko et al. find them), of a lens below alpha = 1/2, and special cases.
const std::vector<Parameters> kLenses{{-0.17, 0.59}, {-0.27, 0.55}, {0.3, 0.7}, {0.6, 0.4},
                                      {-0.5, 0.2},   {0, 0.5},      {0.2, 0},   {0, 1}};

Vec3 random_direction(std::mt19937_64& random) {
    std::normal_distribution<double> n;
    return normalized(Vec3{n(random), n(random), n(random)});
}

DoubleSphere model_of(const Parameters& l) {
    return {kIntrinsics, std::array{l.xi, l.alpha}};
}

/// By the construction with two spheres: the point of the first, seen from the centre of the second, and the
/// pinhole behind that by alpha / (1 - alpha), for alpha < 1.
ImagePoint by_construction(const Parameters& l, const Vec3& p) {
    const Vec3 on_first = normalized(p), on_second = normalized(on_first + Vec3{0, 0, l.xi});
    const Vec3 seen = on_second + Vec3{0, 0, l.alpha / (1 - l.alpha)};
    const double f = 1 / (1 - l.alpha);
    return kIntrinsics.of_plane(f * seen.x / seen.z, f * seen.y / seen.z);
}

TEST(DoubleSphere, FollowsItsConstruction) {
    std::mt19937_64 random(1);
    for (const Parameters& l : kLenses) {
        if (l.alpha == 1) continue;
        const DoubleSphere model = model_of(l);
        for (int i = 0; i < 1000; ++i) {
            const Vec3 p = std::exp(i % 20 - 10.0) * random_direction(random);
            const auto image = model.project(p);
            if (!image || std::hypot(image->x, image->y) > 1e5) continue;
            const ImagePoint expected = by_construction(l, p);
            EXPECT_NEAR(image->x, expected.x, 1e-9 * (1 + std::abs(expected.x)));
            EXPECT_NEAR(image->y, expected.y, 1e-9 * (1 + std::abs(expected.y)));
        }
    }
}

TEST(DoubleSphere, SpecialCasesAreKnownProjections) {
    const DoubleSphere pinhole = model_of({0, 0}), stereographic = model_of({0, 0.5}),
                       orthographic = model_of({0, 1});
    for (const double theta : {0.1, 0.8, 1.4}) {
        const Vec3 d{std::sin(theta), 0, std::cos(theta)};
        const auto radius = [&](const DoubleSphere& m) {
            return (m.project(d)->x - kIntrinsics.cx) / kIntrinsics.fx;
        };
        EXPECT_NEAR(radius(pinhole), std::tan(theta), 1e-12);
        EXPECT_NEAR(radius(stereographic), 2 * std::tan(theta / 2), 1e-12);
        EXPECT_NEAR(radius(orthographic), std::sin(theta), 1e-12);
    }
    EXPECT_FALSE(pinhole.project({1, 0, 0}));
    EXPECT_TRUE(stereographic.project({1e-3, 0, -1}));
    EXPECT_FALSE(orthographic.project({1, 0, -1e-9}));
}

/// Directions up to the rim, beyond 90 degrees from the axis where the lens sees so far.
TEST(DoubleSphere, DirectionsComeBackOverTheWholeField) {
    for (const Parameters& l : kLenses) {
        const DoubleSphere model = model_of(l);
        const double rim = std::acos(model.cos_min());
        for (int i = 0; i < 200; ++i)
            for (int k = 0; k < 7; ++k) {
                // Towards the rim the radius grows ever more slowly, or goes to infinity.
                const double theta = 0.98 * rim * (i + 0.5) / 200, phi = 2 * kPi * k / 7;
                const Vec3 d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
                const auto p = model.project(d);
                ASSERT_TRUE(p);
                EXPECT_TRUE(model.sees(*p));
                EXPECT_LT(norm(model.direction(*p) - d), 1e-12) << l.xi << " " << l.alpha << " " << theta;
                EXPECT_NEAR(norm(model.direction(*p)), 1, 1e-14);
            }
    }
    EXPECT_GT(std::acos(model_of({-0.17, 0.59}).cos_min()), 100 * kPi / 180);
    EXPECT_GT(std::acos(model_of({0.6, 0.4}).cos_min()), 140 * kPi / 180);
}

TEST(DoubleSphere, EndsWhereTheImageWouldFold) {
    for (const Parameters& l : kLenses) {
        const DoubleSphere model = model_of(l);
        const double rim = std::acos(model.cos_min());
        const auto at = [&](double theta) { return model.project({std::sin(theta), 0, std::cos(theta)}); };
        EXPECT_TRUE(at(rim - 1e-6));
        if (rim < kPi - 1e-5) {
            EXPECT_FALSE(at(rim + 1e-6));
        }
        if (l.alpha <= 0.5) continue;
        // The radius is stationary at the rim, and nothing is seen beyond; directions there are the rim's.
        const double r = kIntrinsics.fx / std::sqrt(2 * l.alpha - 1);
        EXPECT_NEAR(at(rim - 1e-6)->x, kIntrinsics.cx + r, 1e-6);
        EXPECT_TRUE(model.sees({kIntrinsics.cx + 0.999 * r, kIntrinsics.cy}));
        EXPECT_FALSE(model.sees({kIntrinsics.cx + 1.001 * r, kIntrinsics.cy}));
        const Vec3 beyond = model.direction({kIntrinsics.cx + 3 * r, kIntrinsics.cy});
        EXPECT_NEAR(norm(beyond), 1, 1e-14);
        EXPECT_NEAR(beyond.z, model.cos_min(), 1e-7);
    }
}

TEST(DoubleSphere, LimitOfThePaperLiesWithin) {
    for (const Parameters& l : kLenses) {
        const double w1 = l.alpha <= 0.5 ? l.alpha / (1 - l.alpha) : (1 - l.alpha) / l.alpha;
        const double w2 = (w1 + l.xi) / std::sqrt(2 * w1 * l.xi + l.xi * l.xi + 1);  // equation 43
        EXPECT_LE(model_of(l).cos_min(), -w2 + 1e-12);
        if (l.xi == 0) {
            EXPECT_NEAR(model_of(l).cos_min(), -w2, 1e-12);
        }
    }
}

TEST(DoubleSphere, JacobianMatchesDifferences) {
    std::mt19937_64 random(2);
    for (const Parameters& l : kLenses) {
        const DoubleSphere model = model_of(l);
        for (int i = 0; i < 300; ++i) {
            const double range = std::exp(i % 10 - 5.0), h = 1e-5 * range;
            const Vec3 p = range * random_direction(random);
            if (p.z < (0.9 * model.cos_min() + 0.1) * range) continue;
            const ProjectionJacobian J = model.jacobian(p);
            for (int k = 0; k < 3; ++k) {
                Vec3 step{};
                step[k] = h;
                const auto after = model.project(p + step), before = model.project(p - step);
                ASSERT_TRUE(after && before);
                const double scale = 1e-6 * (norm(J.x) + norm(J.y));
                EXPECT_NEAR(J.x[k], (after->x - before->x) / (2 * h), scale);
                EXPECT_NEAR(J.y[k], (after->y - before->y) / (2 * h), scale);
            }
            EXPECT_NEAR(dot(J.x, p), 0, 1e-11 * norm(J.x) * range);  // along the ray nothing moves
        }
        EXPECT_NEAR(norm(model.jacobian({0, 0, 1}).x), model.pixels_per_radian(), 1e-9);
    }
}

TEST(DoubleSphere, IsValidForItsParametersOnly) {
    EXPECT_TRUE(model_of({-0.9, 1}).is_valid());
    for (const Parameters& l : {Parameters{-1, 0.5}, Parameters{1, 0.5}, Parameters{0, -0.01}, Parameters{0, 1.01},
                                Parameters{std::nan(""), 0.5}})
        EXPECT_FALSE(model_of(l).is_valid()) << l.xi << " " << l.alpha;
}

}  // namespace
}  // namespace narpa::double_sphere
