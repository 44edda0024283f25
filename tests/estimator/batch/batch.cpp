// Batches of simulated flights: errors of the model are found with the right covariance, and those that the flight
// does not determine are named.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "tests/estimator/batch/batch_flight.h"

namespace narpa {
namespace {

using U = BatchUnknown;
using test::BatchFlight;

MotionModel free_body() {
    return {.acceleration_psd = 1e-8, .angular_acceleration_psd = 1e-10};
}

BatchResult solved(const BatchFlight& flight, const BatchOptions& options, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const BatchInput input = flight.input(test::batch_tracer(), random);
    const auto result = solve_batch(input, options);
    EXPECT_TRUE(result) << result.error().text();
    return result ? *result : BatchResult{};
}

/// Errors within a standard deviation or two of default priors.
BatchValues wrong_model() {
    BatchValues truth{};
    at(truth, U::scale) = 0.01, at(truth, U::focal) = -0.01, at(truth, U::centre_x) = 2,
              at(truth, U::centre_y) = -1.5;
    at(truth, U::k1) = 0.03, at(truth, U::camera_rx) = 0.005, at(truth, U::camera_ry) = -0.004;
    at(truth, U::camera_rz) = 0.003, at(truth, U::lidar_rx) = -0.004, at(truth, U::lidar_ry) = 0.005;
    at(truth, U::lidar_rz) = 0.002, at(truth, U::clock) = 0.02, at(truth, U::range_bias) = 0.03;
    return truth;
}

/// Sum of the squares of three parts.
double squares(const std::vector<double>& parts, std::size_t first) {
    double sum = 0;
    for (std::size_t i = first; i < first + 3; ++i) sum += parts[i] * parts[i];
    return sum;
}

TEST(Batch, FindsErrorsOfTheCameraExactlyWithoutNoise) {
    BatchFlight flight;
    flight.frames = 25, flight.pixel_noise = 0;
    const BatchValues wrong = wrong_model();
    for (const U u : {U::focal, U::centre_x, U::centre_y, U::k1}) at(flight.truth, u) = at(wrong, u);
    BatchOptions options{.motion = free_body(),
                         .prior_sigma = test::priors_of({U::focal, U::centre_x, U::centre_y, U::k1})};
    const BatchResult r = solved(flight, options, 3);
    EXPECT_TRUE(r.settled);
    for (const BatchEstimate& e : r.unknowns) {
        EXPECT_TRUE(e.is_determined) << batch_unknowns()[std::size_t(e.unknown)].name;
        EXPECT_NEAR(e.value, at(flight.truth, e.unknown), 0.3 * e.sigma)
            << batch_unknowns()[std::size_t(e.unknown)].name;
    }
}

/// Truths are drawn from the priors, so the mean NEES is the number of unknowns.
TEST(Batch, CovarianceOfFramesIsConsistent) {
    BatchFlight flight;
    flight.frames = 20;
    const BatchOptions options{
        .motion = free_body(),
        .prior_sigma = test::priors_of({U::scale, U::focal, U::centre_x, U::centre_y, U::k1, U::camera_rx,
                                        U::camera_ry, U::camera_rz, U::clock})};
    constexpr int kFlights = 40;
    double nees = 0, pose_nees = 0, states = 0;
    for (int k = 0; k < kFlights; ++k) {
        std::mt19937_64 random(100 + std::uint64_t(k));
        std::normal_distribution<double> normal;
        for (std::size_t i = 0; i < kBatchUnknowns; ++i) flight.truth[i] = options.prior_sigma[i] * normal(random);
        const BatchResult r = solved(flight, options, 500 + std::uint64_t(k));
        ASSERT_EQ(r.unknowns.size(), 9u);
        nees += test::unknowns_nees(r, flight.truth) / kFlights;
        for (const BatchState& s : r.states) {
            const Rigid3 truth = flight.T_chaser_target(1e-9 * double(s.t_ns));
            pose_nees += normalised_error_squared(error_between(s.T_chaser_target, truth), s.pose_covariance);
            ++states;
        }
    }
    EXPECT_NEAR(nees, 9, 2.5 * std::sqrt(18.0 / kFlights));
    EXPECT_NEAR(pose_nees / states, 6, 1.5) << "states of a flight have errors in common";
}

TEST(Batch, CovarianceOfSweepsAndFramesIsConsistent) {
    BatchFlight flight;
    flight.frames = 10, flight.sweeps = 10;
    const BatchOptions options{.motion = free_body()};
    constexpr int kFlights = 30;
    double nees = 0;
    for (int k = 0; k < kFlights; ++k) {
        std::mt19937_64 random(100 + std::uint64_t(k));
        std::normal_distribution<double> normal;
        for (std::size_t i = 0; i < kBatchUnknowns; ++i) flight.truth[i] = options.prior_sigma[i] * normal(random);
        const BatchResult r = solved(flight, options, 900 + std::uint64_t(k));
        ASSERT_EQ(r.unknowns.size(), 13u);
        nees += test::unknowns_nees(r, flight.truth) / kFlights;
    }
    EXPECT_NEAR(nees, 13, 2.5 * std::sqrt(26.0 / kFlights));
}

/// All errors at once, by camera and LiDAR over a path that is known.
TEST(Batch, TellsAllErrorsApartOverAKnownPath) {
    BatchFlight flight;
    flight.frames = 15, flight.sweeps = 15, flight.truth = wrong_model();
    const BatchOptions options{.motion = free_body(), .path = PathSigma{1e-4, 1e-3}};
    const BatchResult r = solved(flight, options, 5);
    ASSERT_EQ(r.unknowns.size(), 13u);
    EXPECT_TRUE(r.undetermined.empty());
    for (const BatchEstimate& e : r.unknowns) {
        EXPECT_TRUE(e.is_determined) << batch_unknowns()[std::size_t(e.unknown)].name;
        EXPECT_LT(std::abs(e.value - at(flight.truth, e.unknown)) / e.sigma, 4)
            << batch_unknowns()[std::size_t(e.unknown)].name;
        EXPECT_LT(e.sigma, 0.4 * e.prior_sigma) << batch_unknowns()[std::size_t(e.unknown)].name;
    }
}

/// One camera does not tell the target's size from its distance, nor its mount from the target's attitude if the
/// chaser does not turn; nor its clock.
TEST(Batch, NamesWhatIsNotDetermined) {
    BatchFlight flight;
    flight.frames = 20, flight.turns = false, flight.truth = wrong_model();
    const BatchResult r = solved(flight, {.motion = free_body()}, 7);
    for (const U u : {U::scale, U::camera_rx, U::camera_ry, U::camera_rz, U::clock}) {
        EXPECT_FALSE(test::of(r, u).is_determined) << batch_unknowns()[std::size_t(u)].name;
        EXPECT_GT(test::of(r, u).sigma, 0.7 * test::of(r, u).prior_sigma);
    }
    EXPECT_TRUE(test::of(r, U::focal).is_determined);
    EXPECT_TRUE(test::of(r, U::k1).is_determined);
    EXPECT_GE(r.undetermined.size(), 5u);
    EXPECT_EQ(std::ranges::count(r.unknowns, U::range_bias, &BatchEstimate::unknown), 0) << "there is no LiDAR";
}

/// Camera and LiDAR at one place see the difference of their mounts, not a rotation of both.
TEST(Batch, NamesCombinationsThatAreNotDetermined) {
    BatchFlight flight;
    flight.frames = 12, flight.sweeps = 12, flight.turns = false;
    at(flight.truth, U::camera_rz) = 0.005;
    const BatchOptions options{.motion = free_body(),
                               .prior_sigma = test::priors_of({U::camera_rx, U::camera_ry, U::camera_rz,
                                                               U::lidar_rx, U::lidar_ry, U::lidar_rz})};
    const BatchResult r = solved(flight, options, 8);
    ASSERT_EQ(r.undetermined.size(), 3u);
    for (const BatchDirection& d : r.undetermined) {
        EXPECT_NEAR(d.sigma, 1, 0.01);
        EXPECT_NEAR(squares(d.parts, 0), 0.5, 0.01) << "half of it is of the camera";
        EXPECT_NEAR(squares(d.parts, 3), 0.5, 0.01) << "half of it is of the LiDAR";
    }
    // The camera's z is the LiDAR's y but for 2 degrees.
    const double difference = test::of(r, U::camera_rz).value - test::of(r, U::lidar_ry).value;
    EXPECT_NEAR(difference, 0.005, 1e-3);
    EXPECT_NEAR(test::of(r, U::camera_rz).sigma, std::sqrt(0.5) * test::of(r, U::camera_rz).prior_sigma, 1e-4);
}

TEST(Batch, OutliersHaveLittleWeight) {
    BatchFlight flight;
    flight.frames = 20, flight.outliers = 0.1;
    at(flight.truth, U::focal) = 0.01, at(flight.truth, U::k1) = -0.02;
    const BatchOptions options{.motion = free_body(), .prior_sigma = test::priors_of({U::focal, U::k1})};
    const BatchResult dirty = solved(flight, options, 9);
    flight.outliers = 0;
    const BatchResult clean = solved(flight, options, 9);
    for (const U u : {U::focal, U::k1}) {
        EXPECT_LT(std::abs(test::of(dirty, u).value - at(flight.truth, u)), 4 * test::of(dirty, u).sigma);
        EXPECT_LT(test::of(dirty, u).sigma, 2 * test::of(clean, u).sigma);
    }
    EXPECT_NEAR(dirty.residuals[5].downweighted, 0.1, 0.1);
    EXPECT_LT(clean.residuals[5].downweighted, 0.03);
}

/// Points in overlapping windows share errors: as independent ones they would make sigmas too small.
TEST(Batch, SharedErrorsOfPointsAreNotAveraged) {
    BatchFlight flight;
    flight.frames = 10, flight.per_cluster = 6;
    const BatchOptions options{.motion = free_body(),
                               .prior_sigma = test::priors_of({U::focal, U::centre_x, U::k1})};
    double stated = 0, untold = 0;
    constexpr int kFlights = 20;
    for (int k = 0; k < kFlights; ++k) {
        flight.is_stated = true;
        stated += test::unknowns_nees(solved(flight, options, 40 + std::uint64_t(k)), {}) / kFlights;
        flight.is_stated = false;
        untold += test::unknowns_nees(solved(flight, options, 40 + std::uint64_t(k)), {}) / kFlights;
    }
    EXPECT_LT(stated, 3 + 2.5 * std::sqrt(6.0 / kFlights));
    EXPECT_GT(untold, 2 * stated);
}

TEST(Batch, RefusesTooFewTimesAndBadSigmas) {
    BatchFlight flight;
    flight.frames = 3;
    std::mt19937_64 random(1);
    const BatchInput three = flight.input(test::batch_tracer(), random);
    EXPECT_NE(solve_batch(three, {}).error().what.find("at 3 times, expected at least 4"), std::string::npos);
    BatchOptions bad;
    at(bad.prior_sigma, U::k1) = -1;
    EXPECT_NE(solve_batch(three, bad).error().what.find("k1: the prior's standard deviation is -1"),
              std::string::npos);
    EXPECT_FALSE(solve_batch({}, {}));
}

}  // namespace
}  // namespace narpa
