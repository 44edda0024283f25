// ICP on shapes whose symmetries are known: which motions it reports as unobservable, and that it leaves these
// alone.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <functional>
#include <random>

#include "base/constants.h"
#include "estimator/cloud/cloud_icp.h"
#include "estimator/filter/pose_filter.h"
#include "estimator/uncertainty/observed_error.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

const Rigid3 kTruth{normalized(Quat{0.8, 0.3, -0.4, 0.2}), {1.0, 12.0, -0.5}};

struct SurfacePoint {
    Vec3 position, normal;
};
using Draw = std::function<SurfacePoint(std::mt19937_64&)>;

double uniform(std::mt19937_64& random, double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
}

/// On the first `faces` of +x, +y, +z, -x, -y, -z of a cube of 2 m.
Draw on_cube(int faces) {
    return [faces](std::mt19937_64& random) {
        const int face = static_cast<int>(random() % static_cast<std::uint64_t>(faces)), axis = face % 3;
        Vec3 p, n;
        n[axis] = face < 3 ? 1 : -1;
        p[axis] = n[axis];
        p[(axis + 1) % 3] = uniform(random, -0.99, 0.99);
        p[(axis + 2) % 3] = uniform(random, -0.99, 0.99);
        return SurfacePoint{p, n};
    };
}
/// On a sphere of 1 m.
SurfacePoint on_sphere(std::mt19937_64& random) {
    const Vec3 n = test::random_direction(random);
    return {n, n};
}
/// On a cylinder of radius 1 m and length 3 m, `capped` of the points on the disc that ends it.
Draw on_cylinder(double capped) {
    return [capped](std::mt19937_64& random) {
        const double angle = uniform(random, 0, 2 * kPi);
        const Vec3 n{std::cos(angle), std::sin(angle), 0};
        if (uniform(random, 0, 1) >= capped) return SurfacePoint{n + Vec3{0, 0, uniform(random, -1.45, 1.45)}, n};
        return SurfacePoint{0.98 * std::sqrt(uniform(random, 0, 1)) * n + Vec3{0, 0, 1.5}, {0, 0, 1}};
    };
}

Mesh cylinder(int sides, bool cap) {
    Mesh m;
    m.name = "cylinder";
    const auto n = static_cast<std::uint32_t>(sides);
    for (std::uint32_t i = 0; i < n; ++i)
        for (const double z : {-1.5, 1.5}) {
            const double a = 2 * kPi * i / n;
            m.positions.push_back(vec_cast<float>(Vec3{std::cos(a), std::sin(a), z}));
        }
    for (std::uint32_t i = 0; i < n; ++i) {
        const std::uint32_t a = 2 * i, b = 2 * ((i + 1) % n);
        m.faces.push_back({a, b, b + 1});
        m.faces.push_back({a, b + 1, a + 1});
        if (cap && i > 0 && i + 1 < n) m.faces.push_back({1, a + 1, b + 1});
    }
    m.face_material.assign(m.faces.size(), 0);
    return m;
}

/// A return from each point, by a beam of its own that meets the surface up to 50 degrees off its normal.
std::vector<RangePoint> returns(const Draw& draw, int count, double noise_m, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0, noise_m);
    std::vector<RangePoint> points;
    for (int i = 0; i < count; ++i) {
        const SurfacePoint s = draw(random);
        const Vec3 off = cross(s.normal, test::random_direction(random));
        const Vec3 origin = s.position + 4.0 * normalized(s.normal + off);
        points.push_back({kTruth * origin, kTruth.q * normalized(s.position - origin), 4.0, 0});
        if (noise_m > 0) points.back().range_m += noise(random);
    }
    return points;
}

struct SweptShape {
    const char* name;
    Draw draw;
    int unobserved;
    std::function<void(Scene&)> add;
};
const auto add_box = [](Scene& s) { test::add_mesh(s, test::box(2, 2, 2)); };
const std::vector<SweptShape> kShapes{
    {"sphere", on_sphere, 3, [](Scene& s) { test::add_sphere(s, 1, {}); }},
    {"open cylinder", on_cylinder(0), 2, [](Scene& s) { test::add_mesh(s, cylinder(720, false)); }},
    {"cylinder and cap", on_cylinder(0.2), 1, [](Scene& s) { test::add_mesh(s, cylinder(720, true)); }},
    {"one plane", on_cube(1), 3, add_box},
    {"two faces of a cube", on_cube(2), 1, add_box},
    {"three faces of a cube", on_cube(3), 0, add_box},
    {"cube", on_cube(6), 0, add_box},
};

/// The part of an error that lies along the motions that were not seen: metres at the points' distance.
double along_unobserved(const CloudEstimate& e, const Vector6& error) {
    const Vector6 parts = e.observability.motions.inverse() * error;
    double sum = 0;
    for (int i = 0; i < e.observability.unobserved; ++i) sum += parts[i] * parts[i];
    return std::sqrt(sum);
}

Vector6 start_error() {
    Vector6 e;
    e << 0.004, -0.003, 0.005, 0.01, -0.02, 0.015;
    return 0.1 * e;
}

/// From 4000 returns.
Result<CloudEstimate> align(const SweptShape& shape, double noise_m) {
    Scene scene;
    scene.materials.push_back(test::lambert(0.5f));
    shape.add(scene);
    auto tracer = Tracer::create(scene, 1);
    if (!tracer) return tracer.error();
    IcpSettings settings;
    settings.noise = {noise_m, 0};
    return CloudIcp(*tracer, 0, settings)
        .align(returns(shape.draw, 4000, noise_m, 5), {}, displaced(kTruth, start_error()));
}

TEST(IcpShapes, UnobservableMotionsAreReported) {
    for (const SweptShape& shape : kShapes) {
        SCOPED_TRACE(shape.name);
        const auto e = align(shape, 0.002);
        ASSERT_TRUE(e) << e.error().text();
        EXPECT_EQ(e->observability.unobserved, shape.unobserved);
        EXPECT_TRUE(e->settled);
    }
}

/// With standard deviations of 0.1 mm beside motions of which nothing is known, a covariance cannot be told in
/// double precision; the filter takes the root of the information, and keeps what it knew of the other motions.
TEST(IcpShapes, TheFilterUpdatesObservedMotionsOnly) {
    for (const SweptShape& shape : kShapes) {
        SCOPED_TRACE(shape.name);
        const auto e = align(shape, 1e-4);
        ASSERT_TRUE(e) << e.error().text();
        const int observed = 6 - shape.unobserved;
        EXPECT_GT(e->root_information.bottomRows(observed).rowwise().norm().minCoeff(), 0);
        EXPECT_EQ(e->root_information.topRows(shape.unobserved).squaredNorm(), 0);

        // The filter's frame and the LiDAR's are the same.
        Matrix12 before = Matrix12::Zero();
        before.diagonal() << 0.04, 0.04, 0.04, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6;
        const Rigid3 guess = displaced(kTruth, 0.5 * start_error());
        auto filter = PoseFilter::create({}, 0, {guess.t, {}, guess.q, {}}, before);
        ASSERT_TRUE(filter);
        PoseMeasurement m;
        m.T_sensor_target = e->T_lidar_target;
        m.root_information = e->root_information;
        EXPECT_EQ(filter->update(m).outcome, UpdateOutcome::taken);
        const auto& P = filter->covariance();
        EXPECT_EQ(Eigen::LLT<Matrix12>(P).info(), Eigen::Success);
        // Of the pose, in the LiDAR's axes, along the motions that were seen and those that were not.
        const Eigen::Matrix3d R = rotation_matrix(guess.q);
        const Matrix6 along = e->observability.motions.inverse();
        const auto pose_part = [&](const Matrix12& C) {
            Matrix6 axes = Matrix6::Zero();
            axes.topLeftCorner<3, 3>() = R * C.block<3, 3>(6, 6) * R.transpose();
            axes.topRightCorner<3, 3>() = R * C.block<3, 3>(6, 0);
            axes.bottomLeftCorner<3, 3>() = axes.topRightCorner<3, 3>().transpose();
            axes.bottomRightCorner<3, 3>() = C.block<3, 3>(0, 0);
            return Matrix6(along * axes * along.transpose());
        };
        const Matrix6 known = pose_part(before), now = pose_part(P);
        for (int i = shape.unobserved; i < 6; ++i) EXPECT_LT(now(i, i), 1e-4 * known(i, i)) << i;
        if (const int n = shape.unobserved; n > 0) {
            // The others are now exact: what is left is what was known of these, given them.
            const Eigen::MatrixXd given = known.inverse().topLeftCorner(n, n).inverse();
            for (int i = 0; i < n; ++i) EXPECT_NEAR(now(i, i), given(i, i), 0.02 * given(i, i)) << i;
        }
        EXPECT_NE(PoseFilter::create({}, m, 1, 0.1).has_value(), shape.unobserved > 0)
            << "a filter starts only from what knows all of the pose";
    }
}

/// Three faces of a cube tell as much as all six where rotations are about its centre: 2/15 at least.
TEST(IcpShapes, EigenvaluesOfACubeAreKnown) {
    for (const int faces : {3, 6}) {
        std::mt19937_64 random(3);
        Matrix6 hessian = Matrix6::Zero();
        PointSpread spread;
        for (int i = 0; i < 20'000; ++i) {
            const auto [p, n] = on_cube(faces)(random);
            Vector6 J;
            J << to_eigen(cross(p, n)), to_eigen(n);
            hessian += J * J.transpose();
            spread.weight += 1;
            spread.radius_m += dot(p, p);
        }
        spread.radius_m = std::sqrt(spread.radius_m / spread.weight);
        const Observability o = observability(hessian, spread, 1e-3);
        EXPECT_EQ(o.unobserved, 0);
        EXPECT_NEAR(o.eigenvalues[0], 2.0 / 15, 0.005) << faces << " faces";
        EXPECT_NEAR(o.eigenvalues[5], 1.0 / 3, 0.01) << faces << " faces";
    }
}

TEST(IcpShapes, PosesDoNotDriftAlongUnobservedMotions) {
    for (const SweptShape& shape : kShapes) {
        SCOPED_TRACE(shape.name);
        Scene scene;
        scene.materials.push_back(test::lambert(0.5f));
        shape.add(scene);
        auto tracer = Tracer::create(scene, 1);
        ASSERT_TRUE(tracer);
        const auto points = returns(shape.draw, 1500, 0.002, 6);
        const Rigid3 start = displaced(kTruth, start_error());
        const auto after = [&](int iterations) {
            IcpSettings settings;
            settings.noise = {0.002, 0};
            settings.iterations = iterations;
            settings.settled = 0;
            return *CloudIcp(*tracer, 0, settings).align(points, {}, start);
        };
        const CloudEstimate early = after(5), late = after(55);
        EXPECT_EQ(late.iterations, 55);
        const double moved = along_unobserved(late, error_between(early.T_lidar_target, late.T_lidar_target));
        EXPECT_LT(moved, 1e-6);
        // From the start it is what turns about two axes leave about the third, of the second order in them.
        EXPECT_LT(along_unobserved(late, error_between(start, late.T_lidar_target)),
                  5 * start_error().squaredNorm());
    }
}

/// A search moves the pose along all motions, with few points; those that the sweep does not observe are undone,
/// and keep the covariance of the start. Starts 8 degrees and 0.2 m off, in any direction.
TEST(IcpShapes, SearchesLeaveUnobservedMotionsAtTheStart) {
    std::mt19937_64 random(8);
    const Draw middle = [](std::mt19937_64& r) {  // along the axis no point reaches an end
        SurfacePoint p = on_cylinder(0)(r);
        p.position.z *= 0.7;
        return p;
    };
    const std::vector<SweptShape> shapes{
        kShapes[0],
        {"middle of an open cylinder", middle, 2, kShapes[1].add},
        kShapes[2],
        {"barrel of 96 sides", on_cylinder(0.2), 1, [](Scene& s) { test::add_mesh(s, cylinder(96, true)); }}};
    constexpr double kTurn_rad = 8 * kDegree, kShift_m = 0.2;
    Vector6 sigma;
    sigma << Eigen::Vector3d::Constant(kTurn_rad), Eigen::Vector3d::Constant(kShift_m);
    const Matrix6 known = Matrix6(sigma.cwiseAbs2().asDiagonal()) / 3;
    double nees = 0, freedom = 0;
    for (const SweptShape& shape : shapes) {
        Scene scene;
        scene.materials.push_back(test::lambert(0.5f));
        shape.add(scene);
        auto tracer = Tracer::create(scene, 1);
        ASSERT_TRUE(tracer);
        CloudIcp icp(*tracer, 0, {.noise = {0.02, 0}});
        for (std::uint64_t trial = 0; trial < 6; ++trial) {
            SCOPED_TRACE(std::string(shape.name) + " " + std::to_string(trial));
            const auto points = returns(shape.draw, 800, 0.02, 20 + trial);
            const Rigid3 start = displaced(kTruth, random_error(kTurn_rad, kShift_m, random));
            const auto e = icp.align(points, {}, start, kShift_m + 1.8 * kTurn_rad, {}, known);
            ASSERT_TRUE(e) << e.error().text();
            ASSERT_EQ(e->answer.kind, AnswerKind::unobservable) << e->answer.why;
            ASSERT_EQ(e->observability.unobserved, shape.unobserved);
            const Rigid3 back = nearest_equivalent(e->T_lidar_target, e->observability, start);
            const Vector6 moved = error_between(e->T_lidar_target, back);
            EXPECT_LT(moved.head<3>().norm(), 0.1 * kDegree);
            EXPECT_LT(moved.tail<3>().norm(), 2e-3);
            for (int i = 0; i < shape.unobserved; ++i) {
                const Vector6 along = e->observability.motions.inverse().row(i);
                EXPECT_NEAR(along.dot(e->covariance * along), along.dot(known * along), 1e-6);
            }
            const ObservedError error = observed_error(e->T_lidar_target, e->covariance, e->answer, kTruth);
            EXPECT_EQ(error.freedom, 6 - shape.unobserved);
            EXPECT_LT(error.squared, 25);
            nees += error.squared, freedom += error.freedom;
        }
    }
    EXPECT_NEAR(nees / freedom, 1, 0.35) << "chi-square with " << freedom << " degrees of freedom";
}

}  // namespace
}  // namespace narpa
