// Covariances of poses whose measurements respond to motions otherwise than the Jacobian says.
#include "estimator/uncertainty/response.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

Matrix6 lopsided_covariance() {
    Matrix6 root = Matrix6::Zero();
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j <= i; ++j) root(i, j) = i == j ? 1 + 0.3 * i : 0.1 * (i - 2 * j);
    return root * root.transpose();
}

TEST(Response, OfIdentityKeepsTheCovariance) {
    const Matrix6 C = lopsided_covariance();
    EXPECT_LT((covariance_by_response(C, Matrix6::Identity()) - C).norm(), 1e-12 * C.norm());
}

TEST(Response, OfOneHalfQuadruplesTheVariance) {
    Matrix6 response = Matrix6::Identity();
    response(2, 2) = 0.5;
    const Matrix6 C = covariance_by_response(Matrix6::Identity(), response);
    EXPECT_NEAR(C(2, 2), 4, 1e-12);
    EXPECT_NEAR(C(1, 1), 1, 1e-12);
}

TEST(Response, AboveOneReducesVarianceOnlyUpToItsLimit) {
    EXPECT_LT(
        (covariance_by_response(lopsided_covariance(), 3 * Matrix6::Identity()) - lopsided_covariance()).norm(),
        1e-12);
    const Matrix6 taken = covariance_by_response(lopsided_covariance(), 3 * Matrix6::Identity(), 1.5);
    EXPECT_LT((taken - lopsided_covariance() / 2.25).norm(), 1e-12);
}

TEST(Response, BelowOneHalfKeepsOtherVariances) {
    Matrix6 response = 2 * Matrix6::Identity();
    response(2, 2) = 0.6;
    EXPECT_NEAR(covariance_by_response(Matrix6::Identity(), response, 1.5)(0, 0), 1 / 2.25, 1e-12);
    response(2, 2) = 0.4;
    EXPECT_NEAR(covariance_by_response(Matrix6::Identity(), response, 1.5)(0, 0), 1, 1e-12);
}

/// What a measurement shows of nothing is not known.
TEST(Response, OfZeroMakesAMotionUnobserved) {
    Matrix6 response = Matrix6::Identity();
    response(0, 0) = 0;
    const Matrix6 C = covariance_by_response(Matrix6::Identity(), response);
    EXPECT_NEAR(C(0, 0), 1 / (kResponseMin * kResponseMin), 1);
    EXPECT_NEAR(C(3, 3), 1, 1e-9);
}

/// Scatter of poses where J' r = 0, and the covariance that is stated for them: J is wrong by as much as it holds
/// of one motion.
TEST(Response, CovarianceIsTheScatterOfPosesFromAWrongJacobian) {
    constexpr int kPixels = 60, kDraws = 4000;
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal;
    using Columns = Eigen::Matrix<double, kPixels, 6>;
    const auto draw = [&](double size) {
        Columns out;
        for (double& v : out.reshaped()) v = size * normal(random);
        return out;
    };
    Columns truth = draw(1);
    truth.col(5) *= 0.1;  // the motion that is held least
    const Columns J = truth + draw(0.15);
    const Matrix6 information = J.transpose() * J, C = inverse(information);
    const Matrix6 response = C * J.transpose() * truth;
    const Matrix6 stated = covariance_by_response(C, response);
    const Matrix6 exactly = covariance_by_response(C, response, std::numeric_limits<double>::infinity());
    double nees = 0, by_all = 0, as_before = 0;
    for (int k = 0; k < kDraws; ++k) {
        Eigen::Matrix<double, kPixels, 1> noise;
        for (double& v : noise) v = normal(random);
        const Vector6 error = inverse(J.transpose() * truth) * (J.transpose() * noise);
        nees += normalised_error_squared(error, stated) / kDraws;
        by_all += normalised_error_squared(error, exactly) / kDraws;
        as_before += error.dot(information * error) / kDraws;
    }
    EXPECT_GT(nees, 5);
    EXPECT_LT(nees, 6.3);
    EXPECT_NEAR(by_all, 6, 0.3);
    EXPECT_GT(as_before, 8);
}

}  // namespace
}  // namespace narpa
