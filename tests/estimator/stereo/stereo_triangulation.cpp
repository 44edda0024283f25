// Two-view triangulation against 60-digit arithmetic, its covariance against random draws, and where it must
// refuse.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "estimator/pose/pose_estimate.h"
#include "estimator/stereo/triangulation.h"
#include "tests/support/cameras.h"
#include "tests/support/oracle.h"

namespace narpa {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPaperFocal_px = 1319.4792168823421;  // 500 x 500, 30 degrees from corner to corner

StereoPair pair_with(const Rigid3& T_right_left, double focal_px = kPaperFocal_px) {
    StereoPair pair;
    for (Camera* camera : {&pair.left, &pair.right}) test::set_pinhole(*camera, focal_px, focal_px, 0, 0);
    pair.T_right_left = T_right_left;
    return pair;
}

/// The paper's two poses.
StereoPair descent_pair() {
    return pair_with({{}, {-30, 0, -50}});
}

Vector2d seen(const Camera& camera, const Vector3d& p) {
    const Pinhole c = test::pinhole_of(camera);
    return {c.fx * p.x() / p.z() + c.cx, c.fy * p.y() / p.z() + c.cy};
}
Vector2d left_of(const StereoPair& pair, const Vector3d& p) {
    return seen(pair.left, p);
}
Vector2d right_of(const StereoPair& pair, const Vector3d& p) {
    return seen(pair.right, to_eigen(pair.T_right_left * to_vec3(p)));
}

PixelMeasurement pixel(const Vector2d& px, double sigma_px) {
    return {px, sigma_px * sigma_px * Matrix2d::Identity()};
}

struct OracleCase {
    int id;
    StereoPair pair;
    Vector3d point;
    Vector2d left_px, right_px;
    const nlohmann::json& out;
};

std::vector<OracleCase> cases_of(const nlohmann::json& oracle) {
    std::vector<OracleCase> cases;
    for (const auto& c : oracle["cases"]) {
        const auto& in = c["in"];
        const auto& out = c["out"];
        const auto R = in["R_rl"].get<std::vector<double>>(), t = in["t_rl"].get<std::vector<double>>();
        const Quat q = quat_from_columns({R[0], R[3], R[6]}, {R[1], R[4], R[7]}, {R[2], R[5], R[8]});
        const auto number = [&](const char* key) { return out[key].get<double>(); };
        cases.push_back({c["id"], pair_with({q, {t[0], t[1], t[2]}}, in["f_px"]),
                         Vector3d(number("x_l"), number("y_l"), number("z_l")),
                         Vector2d(number("U_l"), number("V_l")), Vector2d(number("U_r"), number("V_r")), out});
    }
    return cases;
}

TEST(StereoOracle, PrintedDepthIsTheReferenceOrRefused) {
    NEED_ORACLE(oracle, "stereo");
    int refused = 0;
    for (const OracleCase& c : cases_of(oracle)) {
        const auto depth = printed_depth_m(c.pair, c.left_px, c.right_px);
        ASSERT_EQ(depth.has_value(), c.out.contains("sigma_z_per_px_U_formula")) << c.id;
        if (depth) {
            EXPECT_NEAR(*depth, c.point.z(), 1e-10 * c.out["sigma_z_per_px_U_formula"].get<double>()) << c.id;
            continue;
        }
        EXPECT_NE(depth.error().what.find("expected a baseline"), std::string::npos) << c.id;
        ++refused;
    }
    EXPECT_EQ(refused, 3) << "the epipole, the column through it, a vertical baseline";
}

TEST(StereoOracle, PointAndBoundAreTheReference) {
    NEED_ORACLE(oracle, "stereo");
    constexpr double kSigma_px = 1e-3;  // little enough for forward motion to see the depth
    for (const OracleCase& c : cases_of(oracle)) {
        const TriangulatedPoint p = triangulate(c.pair, pixel(c.left_px, kSigma_px), pixel(c.right_px, kSigma_px));
        if (!c.out.contains("crb_sigma_xyz_per_px")) {
            EXPECT_EQ(p.status, TriangulationStatus::no_parallax) << c.id;
            continue;
        }
        ASSERT_EQ(p.status, TriangulationStatus::good) << c.id;
        EXPECT_LT(p.epipolar_sigmas, 1e-6) << c.id;
        for (int i = 0; i < 3; ++i) {
            const double sigma_per_px = c.out["crb_sigma_xyz_per_px"][static_cast<std::size_t>(i)];
            EXPECT_NEAR(p.point_m[i], c.point[i], 1e-10 * sigma_per_px) << c.id << ", axis " << i;
            EXPECT_NEAR(std::sqrt(p.covariance_m2(i, i)), kSigma_px * sigma_per_px, 1e-6 * kSigma_px * sigma_per_px)
                << c.id << ", axis " << i;
        }
    }
}

struct Geometry {
    const char* name;
    Rigid3 T_right_left;
    Vector3d point;
    double sigma_px;
};

class StereoMonteCarlo : public testing::TestWithParam<Geometry> {};

TEST_P(StereoMonteCarlo, ErrorsHaveTheCovariance) {
    const Geometry& g = GetParam();
    const StereoPair pair = pair_with(g.T_right_left);
    // Ellipses, not circles: correlated, and other in the two pictures.
    Matrix2d C_left, C_right;
    C_left << 1.5, 0.4, 0.4, 0.7;
    C_right << 0.6, -0.3, -0.3, 1.1;
    C_left *= g.sigma_px * g.sigma_px, C_right *= g.sigma_px * g.sigma_px;
    const Matrix2d L_left = C_left.llt().matrixL(), L_right = C_right.llt().matrixL();
    const Vector2d left = left_of(pair, g.point), right = right_of(pair, g.point);
    const TriangulatedPoint exact = triangulate(pair, {left, C_left}, {right, C_right});
    ASSERT_EQ(exact.status, TriangulationStatus::good);

    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    const auto noise = [&] { return Vector2d(normal(random), normal(random)); };
    constexpr int kTrials = 2000;
    Matrix3d scatter = Matrix3d::Zero();
    double nees = 0, missed = 0;
    for (int k = 0; k < kTrials; ++k) {
        const Vector2d a = left + L_left * noise(), b = right + L_right * noise();
        const TriangulatedPoint p = triangulate(pair, {a, C_left}, {b, C_right});
        ASSERT_EQ(p.status, TriangulationStatus::good);
        const Vector3d e = p.point_m - g.point;
        scatter += e * e.transpose() / kTrials;
        nees += e.dot(p.covariance_m2.llt().solve(e)) / kTrials;
        missed += p.epipolar_sigmas * p.epipolar_sigmas / kTrials;
    }
    // Of a variance estimated from n draws the standard error is sqrt(2 / n) of it; 4 of them, on the deviation.
    const double tolerance = 4 * std::sqrt(0.5 / kTrials);
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(std::sqrt(scatter(i, i) / exact.covariance_m2(i, i)), 1, tolerance) << "axis " << i;
    EXPECT_NEAR(nees, 3, 4 * std::sqrt(6.0 / kTrials));
    EXPECT_NEAR(missed, 1, 4 * std::sqrt(2.0 / kTrials));
}
INSTANTIATE_TEST_SUITE_P(
    Geometries, StereoMonteCarlo,
    testing::Values(Geometry{"table", {{}, {-30, 0, -50}}, {100, -40, 800}, 0.1},
                    Geometry{"vertical", {{}, {0, -30, -50}}, {10, 5, 800}, 0.1},
                    Geometry{"forward", {{}, {0, 0, -50}}, {60, 100, 800}, 0.01},
                    Geometry{"turned", {exp_rotation({0.02, -0.05, 0.3}), {-30, 1, -5}}, {-60, 30, 790}, 0.1}),
    [](const auto& at) { return std::string(at.param.name); });

TEST(StereoTriangulation, AVerticalBaselineGivesTheDepthFromTheRows) {
    const StereoPair pair = pair_with({{}, {0, -30, 0}});
    const Vector3d point(10, 5, 800);
    const Vector2d left = left_of(pair, point), right = right_of(pair, point);
    EXPECT_FALSE(printed_depth_m(pair, left, right));
    const TriangulatedPoint p = triangulate(pair, pixel(left, 0.1), pixel(right, 0.1));
    ASSERT_EQ(p.status, TriangulationStatus::good);
    EXPECT_LT((p.point_m - point).norm(), 1e-9);
    // sigma_z = sqrt(2) sigma z^2 / (f b)
    EXPECT_NEAR(std::sqrt(p.covariance_m2(2, 2)), std::sqrt(2.0) * 0.1 * 800 * 800 / (kPaperFocal_px * 30), 1e-3);
}

TEST(StereoTriangulation, AnExactLeftPixelKeepsThePointOnItsRay) {
    const StereoPair pair = descent_pair();
    const Vector3d point(100, -40, 800);
    const Vector2d left = left_of(pair, point), right = right_of(pair, point) + Vector2d(0.2, 0.3);
    const TriangulatedPoint p = triangulate(pair, pixel(left, 1e-5), pixel(right, 0.1));
    ASSERT_EQ(p.status, TriangulationStatus::good);
    EXPECT_LT((left_of(pair, p.point_m) - left).norm(), 1e-8);
    EXPECT_GT(p.epipolar_sigmas, 1);
    // The error lies along the ray: one degree of freedom is left.
    const Vector3d e = p.point_m - point;
    EXPECT_NEAR(e.dot(p.covariance_m2.llt().solve(e)), e.z() * e.z() / p.covariance_m2(2, 2),
                1e-3 * e.z() * e.z() / p.covariance_m2(2, 2));
}

TEST(StereoTriangulation, NothingIsTriangulatedAtTheEpipole) {
    // The direction of travel: both cameras see the point where they see each other.
    const StereoPair pair = descent_pair();
    for (const double z : {60.0, 800.0, 1e6}) {
        const Vector3d point(0.6 * z, 0, z);
        const auto p = triangulate(pair, pixel(left_of(pair, point), 0.1), pixel(right_of(pair, point), 0.1));
        EXPECT_EQ(p.status, TriangulationStatus::no_parallax) << z;
        EXPECT_EQ(p.point_m, Vector3d::Zero());
    }
    const StereoPair forward = pair_with({{}, {0, 0, -50}});
    EXPECT_EQ(triangulate(forward, pixel({0, 0}, 0.1), pixel({0, 0}, 0.1)).status,
              TriangulationStatus::no_parallax);
    EXPECT_FALSE(printed_depth_m(forward, {0, 0}, {0, 0}));
}

TEST(StereoTriangulation, DistinguishesFarFromBehind) {
    const StereoPair pair = descent_pair();
    const auto status = [&](const Vector3d& point) {
        return triangulate(pair, pixel(left_of(pair, point), 0.1), pixel(right_of(pair, point), 0.1)).status;
    };
    EXPECT_EQ(status({0, 10, 5000}), TriangulationStatus::good);
    EXPECT_EQ(status({0, 10, 5e5}), TriangulationStatus::no_parallax);
    EXPECT_EQ(status({10, 10, -800}), TriangulationStatus::behind_camera);
    EXPECT_EQ(status({5, 5, 20}), TriangulationStatus::behind_camera) << "between the two, behind the right one";
    // A star, of which only the direction is known.
    const auto star = triangulate(pair, pixel({30, 40}, 0.1), pixel({30, 40}, 0.1));
    EXPECT_EQ(star.status, TriangulationStatus::no_parallax);
    EXPECT_LT(std::abs(star.inverse_depth_1_m), star.sigma_inverse_depth_1_m);
    EXPECT_LT(star.sigma_inverse_depth_1_m, 1e-5);
    // No baseline at all.
    const auto same = triangulate(pair_with({}), pixel({30, 40}, 0.1), pixel({30, 40}, 0.1));
    EXPECT_EQ(same.status, TriangulationStatus::no_parallax);
}

TEST(StereoTriangulation, RefusesInvalidMeasurements) {
    const StereoPair good = descent_pair();
    const PixelMeasurement px = pixel({30, 40}, 0.1);
    const double nan = std::nan("");
    const auto refused = [](const StereoPair& pair, const PixelMeasurement& left, const PixelMeasurement& right) {
        const TriangulatedPoint p = triangulate(pair, left, right);
        return p.status == TriangulationStatus::bad_input && p.point_m.isZero() && p.covariance_m2.isZero();
    };
    EXPECT_TRUE(refused(good, pixel({nan, 0}, 1), px));
    EXPECT_TRUE(refused(good, px, pixel({0, INFINITY}, 1)));
    EXPECT_TRUE(refused(good, pixel({0, 0}, 0), px));
    EXPECT_TRUE(refused(good, pixel({0, 0}, nan), px));
    PixelMeasurement indefinite = px;
    indefinite.covariance_px2(0, 1) = indefinite.covariance_px2(1, 0) = 1;
    EXPECT_TRUE(refused(good, px, indefinite));
    StereoPair bad = good;
    test::set_pinhole(bad.right, 0, kPaperFocal_px, 0, 0);
    EXPECT_TRUE(refused(bad, px, px));
    bad = good, bad.T_right_left.q = {2, 0, 0, 0};
    EXPECT_TRUE(refused(bad, px, px));
    bad = good, bad.T_right_left.t.z = nan;
    EXPECT_TRUE(refused(bad, px, px));
    EXPECT_FALSE(printed_depth_m(good, {nan, 0}, {0, 0}));
    EXPECT_FALSE(printed_depth_m(bad, {0, 0}, {0, 0}));
}

TEST(StereoTriangulation, GrossErrorsEndInSomePoint) {
    const StereoPair pair = descent_pair();
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> anywhere(-1e4, 1e4);
    int good = 0;
    for (int k = 0; k < 2000; ++k) {
        const auto p = triangulate(pair, pixel({anywhere(random), anywhere(random)}, 1),
                                   pixel({anywhere(random), anywhere(random)}, 1));
        ASSERT_NE(p.status, TriangulationStatus::bad_input);
        ASSERT_TRUE(p.point_m.allFinite() && p.covariance_m2.allFinite());
        if (p.status != TriangulationStatus::good) continue;
        ++good;
        ASSERT_GT(p.point_m.z(), 0);
    }
    EXPECT_GT(good, 0);
}

}  // namespace
}  // namespace narpa
