// How states and covariances move on, against closed forms, laws of conservation and finite differences.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "estimator/filter/discretise.h"
#include "estimator/filter/motion_model.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

constexpr double kOrbit = 1.13e-3;  // rad/s: 400 km above the Earth

const Eigen::Matrix3d kInertia = [] {
    Eigen::Matrix3d J;
    J << 1200, 30, -20, 30, 800, 15, -20, 15, 400;
    return J;
}();
const RelativeState kState{
    {3, -40, 2}, {0.02, 0.1, -0.03}, normalized(Quat{0.1, 0.7, -0.6, 0.3}), {0.06, -0.03, 0.04}};

RelativeState moved(const MotionModel& model, double dt_s, const RelativeState& from,
                    const Vec3& acceleration = {}) {
    RelativeState s = from;
    Matrix12 P = Matrix12::Identity();
    propagate(model, dt_s, acceleration, s, P);
    return s;
}

TEST(FilterMotion, ClohessyWiltshireIsTheClosedForm) {
    MotionModel model;
    model.orbit_rate_rad_s = kOrbit;
    for (const double dt : {0.01, 1.0, 60.0, 2000.0, 5560.0}) {
        const RelativeState s = moved(model, dt, kState);
        Vector6 x, expected;
        x << to_eigen(kState.position_m), to_eigen(kState.velocity_m_s);
        expected = clohessy_wiltshire_transition(kOrbit, dt) * x;
        EXPECT_LT((to_eigen(s.position_m) - expected.head<3>()).norm(), 1e-11 * expected.head<3>().norm()) << dt;
        EXPECT_LT((to_eigen(s.velocity_m_s) - expected.tail<3>()).norm(), 1e-11 * expected.norm() * kOrbit) << dt;
    }
}

TEST(FilterMotion, AKnownAccelerationActs) {
    const Vec3 a{0.01, -0.02, 0.005};
    const RelativeState free = moved({}, 20, kState, a);
    EXPECT_LT(norm(free.position_m - (kState.position_m + 20.0 * kState.velocity_m_s + 200.0 * a)), 1e-12);
    EXPECT_LT(norm(free.velocity_m_s - (kState.velocity_m_s + 20.0 * a)), 1e-14);

    MotionModel model;
    model.orbit_rate_rad_s = kOrbit;
    RelativeState numeric = kState;  // fourth order, from Hill's equations
    const auto rates = [&](const Vec3& r, const Vec3& v) {
        return Vec3{3 * kOrbit * kOrbit * r.x + 2 * kOrbit * v.y, -2 * kOrbit * v.x, -kOrbit * kOrbit * r.z} + a;
    };
    constexpr int kSteps = 3000;
    constexpr double h = 300.0 / kSteps;
    for (int i = 0; i < kSteps; ++i) {
        Vec3 &r = numeric.position_m, &v = numeric.velocity_m_s;
        const Vec3 v1 = v, a1 = rates(r, v), v2 = v + 0.5 * h * a1, a2 = rates(r + 0.5 * h * v1, v2);
        const Vec3 v3 = v + 0.5 * h * a2, a3 = rates(r + 0.5 * h * v2, v3), v4 = v + h * a3;
        const Vec3 a4 = rates(r + h * v3, v4);
        r += h / 6 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
        v += h / 6 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
    const RelativeState s = moved(model, 300, kState, a);
    EXPECT_LT(norm(s.position_m - numeric.position_m), 1e-9);
    EXPECT_LT(norm(s.velocity_m_s - numeric.velocity_m_s), 1e-11);
}

/// The integral of the noise, by many small pieces of the closed transition.
TEST(FilterMotion, NoiseIsThatOfTheIntegral) {
    const double dt = 900, psd = 1e-8;
    MotionModel model;
    model.orbit_rate_rad_s = kOrbit;
    model.acceleration_psd = psd;
    RelativeState s = kState;
    Matrix12 P = Matrix12::Zero();
    propagate(model, dt, {}, s, P);
    Matrix6 sum = Matrix6::Zero();
    constexpr int kPieces = 2000;
    for (int i = 0; i < kPieces; ++i) {
        const Eigen::Matrix<double, 6, 3> G =
            clohessy_wiltshire_transition(kOrbit, (i + 0.5) * dt / kPieces).rightCols<3>();
        sum += psd * dt / kPieces * G * G.transpose();
    }
    EXPECT_LT((P.topLeftCorner<6, 6>() - sum).norm(), 1e-5 * sum.norm());

    MotionModel free;
    free.acceleration_psd = psd;
    P.setZero();
    propagate(free, dt, {}, s, P);
    EXPECT_NEAR(P(0, 0), psd * dt * dt * dt / 3, 1e-14 * P(0, 0));
    EXPECT_NEAR(P(1, 4), psd * dt * dt / 2, 1e-14 * P(1, 4));
    EXPECT_NEAR(P(5, 5), psd * dt, 1e-14 * P(5, 5));
}

TEST(FilterMotion, ATumblingBodyKeepsItsMomentumAndEnergy) {
    MotionModel model;
    model.inertia_kg_m2 = kInertia;
    const auto momentum = [](const RelativeState& s) {
        return s.q_frame_target * to_vec3(kInertia * to_eigen(s.rate_rad_s));
    };
    const auto energy = [](const RelativeState& s) {
        return to_eigen(s.rate_rad_s).dot(kInertia * to_eigen(s.rate_rad_s));
    };
    RelativeState s = kState;
    for (int i = 0; i < 600; ++i) s = moved(model, 1, s);
    EXPECT_LT(norm(momentum(s) - momentum(kState)), 1e-6 * norm(momentum(kState)));
    EXPECT_NEAR(energy(s), energy(kState), 1e-7 * energy(kState));
    EXPECT_GT(norm(s.rate_rad_s - kState.rate_rad_s), 1e-2) << "it tumbles";
    const RelativeState at_once = moved(model, 600, kState);
    EXPECT_LT(error_between(at_once, s).norm(), 1e-5);
}

/// In LVLH axes a target at rest in space turns backwards with the orbit, and one that keeps its face to the Earth
/// stays as it is.
TEST(FilterMotion, TheFrameTurnsWithTheOrbit) {
    MotionModel model;
    model.orbit_rate_rad_s = kOrbit;
    RelativeState s = kState;
    s.rate_rad_s = {};
    EXPECT_LT(
        angle_between(moved(model, 700, s).q_frame_target, exp_rotation({0, 0, -700 * kOrbit}) * s.q_frame_target),
        1e-12);
    s.rate_rad_s = conjugate(s.q_frame_target) * Vec3{0, 0, kOrbit};
    EXPECT_LT(angle_between(moved(model, 700, s).q_frame_target, s.q_frame_target), 1e-12);
}

TEST(FilterMotion, CovariancesFollowTheDerivatives) {
    for (const bool rigid : {false, true})
        for (const double orbit : {0.0, kOrbit}) {
            MotionModel model;
            model.orbit_rate_rad_s = orbit;
            model.acceleration_psd = model.angular_acceleration_psd = 0;
            if (rigid) model.inertia_kg_m2 = kInertia;
            constexpr double kDt = 7, kStep = 1e-5;
            Matrix12 J;
            for (int i = 0; i < 12; ++i) {
                const Vector12 d = kStep * Vector12::Unit(i);
                const RelativeState here = moved(model, kDt, kState);
                J.col(i) = (error_between(here, moved(model, kDt, displaced(kState, d))) -
                            error_between(here, moved(model, kDt, displaced(kState, -d)))) /
                           (2 * kStep);
            }
            RelativeState s = kState;
            Matrix12 P = Matrix12::Identity();
            propagate(model, kDt, {}, s, P);
            EXPECT_LT((P - J * J.transpose()).norm(), 2e-5 * P.norm()) << rigid << orbit;
        }
}

TEST(FilterMotion, ErrorsLeadFromOneStateToTheOther) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    for (int k = 0; k < 100; ++k) {
        Vector12 e;
        for (int i = 0; i < 12; ++i) e[i] = normal(random);
        if (e.segment<3>(6).norm() > 3.1) continue;
        EXPECT_LT((error_between(kState, displaced(kState, e)) - e).norm(), 1e-12);
    }
}

TEST(FilterMotion, BadModelsAreReported) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    MotionModel m;
    EXPECT_TRUE(check(m));
    m.orbit_rate_rad_s = -1;
    EXPECT_NE(check(m).error().text().find("orbit_rate_rad_s = -1"), std::string::npos);
    m = {};
    m.acceleration_psd = kNan;
    EXPECT_FALSE(check(m));
    m = {};
    m.angular_acceleration_psd = -1e-9;
    EXPECT_FALSE(check(m));
    m = {};
    m.inertia_kg_m2 = -kInertia;
    EXPECT_NE(check(m).error().text().find("positive definite"), std::string::npos);
}

}  // namespace
}  // namespace narpa
