// Cameras with changes: what a solver uses agrees with the camera models, and its derivatives with differences.
// Then calibrations from poses that have nothing to do with each other.
#include "estimator/batch/camera_change.h"

#include <gtest/gtest.h>

#include "renderer/projection/kannala_brandt.h"
#include "renderer/projection/projection_kind.h"
#include "tests/estimator/batch/batch_flight.h"

namespace narpa {
namespace {

using U = BatchUnknown;

BatchValues some_change() {
    BatchValues change{};
    at(change, U::focal) = 0.05, at(change, U::aspect) = -0.01;
    at(change, U::centre_x) = 7, at(change, U::centre_y) = -4;
    at(change, U::k1) = -0.2, at(change, U::k2) = 0.05, at(change, U::k3) = 0.03;
    at(change, U::p1) = 0.004, at(change, U::p2) = -0.003;
    return change;
}

std::vector<std::shared_ptr<const CameraModel>> cameras() {
    const Pinhole pinhole(500, 510, 319, 241);
    return {std::make_shared<Pinhole>(pinhole),
            make_projection({&kBrownConrady, pinhole, {-0.1, 0.02, 0.001, 0.002}}),
            make_projection({&kBrownConrady, pinhole, {-0.1, 0.02, 0.001, 0.002, 0.01, 0.05, 0.02, 0.01}}),
            make_projection({&kKannalaBrandt, pinhole, {0.01, -0.02, 0.003, 0.001}})};
}

const std::vector<Vec3> kPoints{{0.1, 0.2, 1}, {-0.5, 0.3, 1.5}, {0.4, -0.4, 1}, {-0.01, 0.02, 3}, {0.6, 0.1, 1.1}};

TEST(ChangedCamera, AgreesWithTheCameraModel) {
    for (const auto& camera : cameras()) {
        const auto model = changed_camera(*camera, some_change());
        if (camera == cameras().back() || !model) continue;
        const ChangedCamera changed(*camera, some_change());
        for (const Vec3& p : kPoints) {
            ChangedImage image;
            ASSERT_TRUE(changed.project(p, image));
            const auto wanted = (*model)->project(p);
            ASSERT_TRUE(wanted);
            EXPECT_NEAR(image.pixel.x(), wanted->x, 1e-9);
            EXPECT_NEAR(image.pixel.y(), wanted->y, 1e-9);
        }
    }
    EXPECT_TRUE(changed_camera(*cameras()[2], some_change()));
    EXPECT_NE(changed_camera(*cameras()[3], some_change()).error().what.find("k1, k2"), std::string::npos);
    EXPECT_EQ((*changed_camera(*cameras()[3], {}))->parameters().values, cameras()[3]->parameters().values);
}

TEST(ChangedCamera, DerivativesAgreeWithDifferences) {
    constexpr double kStep = 1e-6;
    for (const auto& camera : cameras())
        for (const Vec3& p : kPoints) {
            ChangedImage image, low, high;
            ASSERT_TRUE(ChangedCamera(*camera, some_change()).project(p, image));
            for (std::size_t i = 0; i < kCameraUnknowns.size(); ++i) {
                BatchValues less = some_change(), more = less;
                at(less, kCameraUnknowns[i]) -= kStep, at(more, kCameraUnknowns[i]) += kStep;
                ASSERT_TRUE(ChangedCamera(*camera, less).project(p, low));
                ASSERT_TRUE(ChangedCamera(*camera, more).project(p, high));
                const Eigen::Vector2d slope = (high.pixel - low.pixel) / (2 * kStep);
                EXPECT_LT((slope - image.by_camera.col(static_cast<Eigen::Index>(i))).norm(), 1e-4)
                    << batch_unknowns()[std::size_t(kCameraUnknowns[i])].name;
            }
            for (int axis = 0; axis < 3; ++axis) {
                Vec3 less = p, more = p;
                less[axis] -= kStep, more[axis] += kStep;
                ASSERT_TRUE(ChangedCamera(*camera, some_change()).project(less, low));
                ASSERT_TRUE(ChangedCamera(*camera, some_change()).project(more, high));
                EXPECT_LT(((high.pixel - low.pixel) / (2 * kStep) - image.by_point.col(axis)).norm(), 1e-3);
            }
        }
}

TEST(ChangedCamera, HasNoImageBeyondTheFold) {
    BatchValues change{};
    at(change, U::k1) = -0.5;
    const ChangedCamera camera(*cameras()[0], change);
    ChangedImage image;
    EXPECT_TRUE(camera.project({0.5, 0, 1}, image));
    EXPECT_FALSE(camera.project({1.2, 0, 1}, image));
    EXPECT_FALSE(camera.project({0, 0, -1}, image));
}

/// Poses of a flight, each by itself. Truths are drawn from the priors, so that the mean NEES of the camera is the
/// number of its unknowns, and that of the poses six.
TEST(BatchWithoutMotion, CalibratesACamera) {
    BatchOptions options{.has_motion = false};
    options.prior_sigma =
        test::priors_of({U::focal, U::aspect, U::centre_x, U::centre_y, U::k1, U::k2, U::p1, U::p2, U::k3});
    constexpr int kFlights = 30;
    double nees = 0, pose_nees = 0;
    for (int k = 0; k < kFlights; ++k) {
        test::BatchFlight flight;
        flight.frames = 12, flight.step_s = 8, flight.turns = false;
        std::mt19937_64 random(300 + std::uint64_t(k));
        std::normal_distribution<double> normal;
        for (std::size_t i = 0; i < kBatchUnknowns; ++i) flight.truth[i] = options.prior_sigma[i] * normal(random);
        std::mt19937_64 noise(700 + std::uint64_t(k));
        const BatchInput input = flight.input(test::batch_tracer(), noise);
        const auto r = solve_batch(input, options);
        ASSERT_TRUE(r) << r.error().text();
        EXPECT_TRUE(r->settled);
        nees += test::unknowns_nees(*r, flight.truth) / kFlights;
        for (std::size_t i = 0; i < r->states.size(); ++i)
            pose_nees += normalised_error_squared(
                             error_between(r->states[i].T_chaser_target, *input.frames[i].time.T_chaser_target),
                             r->states[i].pose_covariance) /
                         static_cast<double>(r->states.size()) / kFlights;
    }
    EXPECT_NEAR(nees, 9, 2.5 * std::sqrt(18.0 / kFlights));
    EXPECT_NEAR(pose_nees, 6, 1.5);
}

TEST(BatchWithoutMotion, TakesOnePoseAndNoClock) {
    test::BatchFlight flight;
    flight.frames = 1;
    std::mt19937_64 random(1);
    const BatchInput input = flight.input(test::batch_tracer(), random);
    BatchOptions options{.has_motion = false, .prior_sigma = test::priors_of({U::focal})};
    const auto r = solve_batch(input, options);
    ASSERT_TRUE(r) << r.error().text();
    EXPECT_EQ(r->states.size(), 1u);
    EXPECT_EQ(r->parameters, 7);
    options.prior_sigma = test::priors_of({U::clock});
    EXPECT_NE(solve_batch(input, options).error().what.find("neither path nor clock"), std::string::npos);
}

}  // namespace
}  // namespace narpa
