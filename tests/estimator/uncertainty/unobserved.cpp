// Motions that a measurement does not observe stay at the guess.
#include "estimator/uncertainty/unobserved.h"

#include <gtest/gtest.h>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

constexpr double kRange_m = 10;

/// A covariance whose rotation about z is unobserved, and correlated with the others.
Matrix6 unobserved_roll() {
    Matrix6 L = 1e-3 * Matrix6::Identity();
    L(2, 2) = 0.5, L(3, 2) = 0.02, L(4, 1) = 5e-4;
    return L * L.transpose();
}

TEST(UnobservedMotions, StayAtTheGuess) {
    const Matrix6 C = unobserved_roll();
    const Observability o = observability_of(C, kRange_m);
    ASSERT_EQ(o.unobserved, 1);
    const Vector6 roll = o.motions.col(0);
    EXPECT_LT((unobserved_part(o, 3 * roll) - 3 * roll).norm(), 1e-12);
    for (int i = 1; i < 6; ++i) EXPECT_LT(unobserved_part(o, o.motions.col(i)).norm(), 1e-12) << i;
    const Matrix6 information = inverse(C);
    const Vector6 motion = 0.01 * o.motions.col(3) + 0.002 * o.motions.col(5);
    EXPECT_LT((observed_step(o, information, information * motion) - motion).norm(), 1e-9);
    const Vector6 step = observed_step(o, information, information * (motion + 0.3 * roll));
    EXPECT_LT(unobserved_part(o, step).norm(), 1e-12);
}

TEST(UnobservedMotions, HaveTheCovarianceOfTheGuess) {
    const Matrix6 C = unobserved_roll();
    const Observability o = observability_of(C, kRange_m);
    const Matrix6 with = with_guess(o, C, {0.1, 0.05}, kRange_m);
    EXPECT_NEAR(std::sqrt(with(2, 2)), 0.1, 0.01);
    EXPECT_NEAR(with(0, 0), C(0, 0), 0.01 * C(0, 0));
    EXPECT_EQ(observability_of(with, kRange_m).unobserved, 1);
    EXPECT_TRUE(cholesky(with).positive_definite);
}

}  // namespace
}  // namespace narpa
