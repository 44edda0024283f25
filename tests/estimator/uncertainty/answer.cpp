// What an answer is worth: each class from what makes it so, and what errors of the model add to its covariance.
#include <gtest/gtest.h>

#include <cmath>

#include "estimator/pnp/pnp_refine.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/root_information.h"
#include "tests/estimator/pnp/pnp_support.h"

namespace narpa {
namespace {

Fit good_fit() {
    Fit fit;
    observe({{}, {0, 0, 10}}, 1e-6 * Matrix6::Identity(), fit);
    return fit;
}

TEST(Answer, TheFirstFailedTestDecides) {
    Fit fit = good_fit();
    EXPECT_EQ(judge(fit).kind, AnswerKind::good);
    EXPECT_TRUE(judge(fit).why.empty());
    fit.rivals.push_back({{{}, {0, 0, 11}}, 3});
    const Answer ambiguous = judge(fit);
    EXPECT_EQ(ambiguous.kind, AnswerKind::ambiguous);
    EXPECT_FALSE(ambiguous.usable());
    EXPECT_EQ(ambiguous.rivals.size(), 1U);
    fit.residual = 1.2;
    EXPECT_EQ(judge(fit).kind, AnswerKind::refused);
    EXPECT_NE(judge(fit).why.find("1.2 times"), std::string::npos) << judge(fit).why;
    fit.failed = "no step reduces the cost";
    EXPECT_EQ(judge(fit).why, fit.failed);
    Fit unknown = good_fit();
    unknown.residual = std::nan("");
    EXPECT_EQ(judge(unknown).kind, AnswerKind::refused) << "what is not known to fit does not";
}

TEST(Answer, FarFromTheGuessIsRefused) {
    Fit fit = good_fit();
    const Rigid3 guess{{}, {0, 0, 10}};
    compare_with_guess({exp_rotation({0, 0, 0.5}), {0, 0, 11}}, guess, fit);
    EXPECT_EQ(judge(fit).kind, AnswerKind::good);
    compare_with_guess({exp_rotation({0, 0, 1.5708}), {0, 0, 10}}, guess, fit);
    EXPECT_EQ(judge(fit).kind, AnswerKind::refused) << "by a quarter turn, a symmetry of a cube";
    fit.guess_error = {0.1, 0.05};
    fit.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2;  // 0.01 rad, 0.1 m
    compare_with_guess({exp_rotation({0, 0, 0.119}), {0, 0, 10.69}}, guess, fit);
    EXPECT_EQ(judge(fit).kind, AnswerKind::good) << "further by less than two sigma";
    compare_with_guess({exp_rotation({0, 0, 0.121}), {0, 0, 10.69}}, guess, fit);
    EXPECT_EQ(judge(fit).kind, AnswerKind::refused);
    compare_with_guess({exp_rotation({0, 0, 0.119}), {0, 0, 10.71}}, guess, fit);
    EXPECT_EQ(judge(fit).kind, AnswerKind::refused);
    fit.observability.unobserved = 1;
    EXPECT_EQ(judge(fit).kind, AnswerKind::unobservable) << "that motion may be off by anything";
    compare_with_guess({{}, {0, 0, 16}}, guess, fit);
    EXPECT_EQ(judge(fit).kind, AnswerKind::refused);
}

TEST(Answer, UnobservedMotionsAreListedWithoutInformation) {
    Matrix6 covariance = 1e-6 * Matrix6::Identity();
    covariance(2, 2) = 1;  // a radian of roll
    Fit fit;
    observe({{}, {0, 0, 10}}, covariance, fit);
    const Answer answer = judge(fit);
    EXPECT_EQ(answer.kind, AnswerKind::unobservable);
    EXPECT_TRUE(answer.usable());
    ASSERT_EQ(answer.observability.unobserved, 1);
    const Vector6 motion = answer.observability.motions.col(0).normalized();
    EXPECT_NEAR(std::abs(motion[2]), 1, 1e-9);
    EXPECT_LT((answer.root_information * motion).norm(), 1e-9);
    EXPECT_NEAR((answer.root_information * Vector6::Unit(3)).norm(), 1e3, 1e-3) << "the others are known as well";
    observe({{}, {0, 0, 10}}, Matrix6::Identity() * 100, fit);
    EXPECT_EQ(judge(fit).kind, AnswerKind::refused) << "none is observed";
}

/// Points whose camera or body differs from the believed one: the pose that fits is off by what the closed form
/// says.
TEST(ModelUncertainty, ShiftsAreThoseOfTheFit) {
    std::mt19937_64 random(3);
    const Rigid3 T{test::random_attitude(random), {1.5, -2, 20}};
    const std::vector<Vec3> body = test::random_points(random, 60, 1);
    PnpRefiner refiner(64);
    const auto shift_of = [&](double scale, const Vec3& mesh_m, double focal, const Vec3& boresight) {
        Pinhole camera = test::kPaperCamera;
        camera.fx *= focal, camera.fy *= focal;
        std::vector<Pixel> pixels;
        for (const Vec3& p : body)
            pixels.push_back(test::project(camera, exp_rotation(boresight) * (T * (scale * p + mesh_m))));
        const PnpFit& fit = refiner.refine({&test::kPaperCamera, body, pixels, 1e-3}, T);
        EXPECT_TRUE(fit.ok());
        return error_between(fit.T_camera_body, T);
    };
    constexpr double kSmall = 1e-4;
    const auto expect_column = [&](const PoseShifts& shifts, int column, const Vector6& shift, const char* what) {
        // The sign of a nuisance is free.
        const Vector6 expected = shifts.col(column);
        const double miss = std::min((shift - expected).norm(), (shift + expected).norm());
        EXPECT_LT(miss, 0.03 * expected.norm() + 1e-9)
            << what << ": " << shift.transpose() << " for " << expected.transpose();
    };
    const auto shifts = [&](const ModelUncertainty& u) { return image_shifts(u, T, {}); };
    expect_column(shifts({.scale = kSmall}), 7, shift_of(1 + kSmall, {}, 1, {}), "scale");
    expect_column(shifts({.focal = kSmall}), 8, shift_of(1, {}, 1 + kSmall, {}), "focal length");
    expect_column(shifts({.boresight_rad = kSmall}), 3, shift_of(1, {}, 1, {kSmall, 0, 0}), "boresight");
    // The mesh's shift is in its own axes; the sum over the axes has no direction.
    const PoseShifts mesh = shifts({.mesh_m = kSmall});
    EXPECT_NEAR(shift_of(1, {kSmall, 0, 0}, 1, {}).tail<3>().norm(), mesh.col(0).norm(), 0.01 * kSmall);
    const ApparentMotion moving{{0.1, 0, 0.2}, {0, 0.03, 0}};
    const PoseShifts clock = image_shifts({.clock_s = 0.02}, T, moving);
    EXPECT_LT((clock.col(6) - error_between(T, moved(T, moving, 0.02))).norm(), 1e-9);
}

/// A body as deep as it is near also turns with the focal length.
TEST(ModelUncertainty, FocalLengthShiftIsThatOfTheWeightedPoints) {
    constexpr double kPart = 1e-4;
    std::mt19937_64 random(5);
    const Rigid3 T{test::random_attitude(random), {0.2, -0.3, 3}};
    const std::vector<Vec3> body = test::random_points(random, 8, 1);
    Pinhole camera = test::kPaperCamera;
    camera.fx *= 1 + kPart, camera.fy *= 1 + kPart;
    std::vector<Pixel> pixels;
    for (const Vec3& p : body) pixels.push_back(test::project(camera, T * p));
    PnpRefiner refiner(8);
    const PnpInput input{&test::kPaperCamera, body, pixels, 1e-3};
    const PnpFit& fit = refiner.refine(input, T);
    ASSERT_TRUE(fit.ok());
    const Vector6 moved = error_between(T, fit.T_camera_body), told = kPart * shift_by_focal(input, T);
    EXPECT_LT((moved - told).norm(), 1e-3 * moved.norm()) << moved.transpose() << " for " << told.transpose();
    const Vector6 of_a_point = image_shifts({.focal = kPart}, T, {}).col(8);
    EXPECT_GT((moved - of_a_point).head<3>().norm(), 0.5 * of_a_point.head<3>().norm());
}

TEST(ModelUncertainty, RootInformationEqualsTheInverseCovariance) {
    std::mt19937_64 random(4);
    const Rigid3 T{test::random_attitude(random), {1, 2, 30}};
    const PoseShifts shifts = image_shifts({.scale = 0.01, .boresight_rad = 1e-3}, T, {});
    const Matrix6 C = 1e-4 * Matrix6::Identity(), root = 100 * Matrix6::Identity();
    const Matrix6 W = root_information_with(root, shifts);
    const Matrix6 with = C + shifts * shifts.transpose();
    EXPECT_LT(((W.transpose() * W).inverse() - with).norm(), 1e-9 * with.norm());
}

}  // namespace
}  // namespace narpa
