// Errors and covariances of poses against finite differences and random draws.
#include "estimator/pose/pose_estimate.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <functional>
#include <random>

namespace narpa {
namespace {

const Rigid3 kPose{normalized(Quat{0.3, -0.5, 0.7, 0.2}), {1.5, -2.0, 30.0}};
const Rigid3 kOffset{normalized(Quat{0.9, 0.1, -0.3, 0.2}), {0.4, 3.0, -1.0}};

Matrix6 some_covariance() {
    Matrix6 L = Matrix6::Zero();
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j <= i; ++j) L(i, j) = 1e-3 * (i == j ? 1.0 + 0.3 * i : 0.1 * (i - 2 * j));
    return L * L.transpose();
}

/// Of a function of poses at kPose, by central differences of the error vectors.
Matrix6 numeric_jacobian(const std::function<Rigid3(const Rigid3&)>& f) {
    constexpr double kStep = 1e-6;
    Matrix6 J;
    for (int i = 0; i < 6; ++i) {
        const Vector6 d = kStep * Vector6::Unit(i);
        J.col(i) =
            (error_between(f(kPose), f(displaced(kPose, d))) - error_between(f(kPose), f(displaced(kPose, -d)))) /
            (2 * kStep);
    }
    return J;
}

TEST(PoseError, LeadsFromOnePoseToTheOther) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    for (int trial = 0; trial < 200; ++trial) {
        Vector6 e;
        for (int i = 0; i < 6; ++i) e[i] = normal(random);
        if (e.head<3>().norm() > 3.1) continue;
        const Rigid3 there = displaced(kPose, e);
        EXPECT_LT((error_between(kPose, there) - e).norm(), 1e-12);
        EXPECT_LT((error_between(kPose, {-there.q, there.t}) - e).norm(), 1e-12)
            << "the other sign of the quaternion";
    }
    EXPECT_LT(error_between(kPose, kPose).norm(), 1e-15);
}

TEST(PoseError, CovarianceFollowsAProduct) {
    const Matrix6 J = numeric_jacobian([](const Rigid3& T) { return T * kOffset; });
    const Matrix6 C = some_covariance(), expected = J * C * J.transpose();
    EXPECT_LT((covariance_of_product(kPose, C, kOffset) - expected).norm(), 1e-7 * expected.norm());
}

TEST(PoseError, CovarianceTurnsWithTheAxes) {
    const Matrix6 J = numeric_jacobian([](const Rigid3& T) { return kOffset * T; });
    const Matrix6 C = some_covariance(), expected = J * C * J.transpose();
    EXPECT_LT((covariance_in_other_axes(kOffset.q, C) - expected).norm(), 1e-7 * expected.norm());
}

TEST(PoseError, NormalisedSquaresAreChiSquare) {
    const Matrix6 C = some_covariance(), L = Eigen::LLT<Matrix6>(C).matrixL();
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    constexpr int kDraws = 20'000;
    double sum = 0;
    for (int k = 0; k < kDraws; ++k) {
        Vector6 e;
        for (int i = 0; i < 6; ++i) e[i] = normal(random);
        sum += normalised_error_squared(L * e, C);
    }
    EXPECT_NEAR(sum / kDraws, 6, 4 * std::sqrt(12.0 / kDraws));  // mean 6, variance 12
    EXPECT_EQ(normalised_error_squared(Vector6(Vector6::Ones()), Matrix6(Matrix6::Zero())),
              std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace narpa
