#include "estimator/filter/motion_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "estimator/filter/discretise.h"

namespace narpa {
namespace {

/// Largest rotation of a tumbling body in one step: the fourth-order steps have a relative error of 1e-9 then.
constexpr double kTumbleStepRad = 0.02;

/// System matrix of (position, velocity).
Matrix6 translation_rates(const MotionModel& model) {
    const double n = model.orbit_rate_rad_s;
    Matrix6 F = Matrix6::Zero();
    F.topRightCorner<3, 3>().setIdentity();
    if (model.ground) {
        F.bottomLeftCorner<3, 3>() = model.ground->gradient_s2;
    } else {
        F(3, 0) = 3 * n * n;
        F(5, 2) = -n * n;
    }
    F(3, 4) = 2 * n;
    F(4, 3) = -2 * n;
    return F;
}

/// Spectral density of white noise on the last three of six states.
Matrix6 driven(double psd) {
    Matrix6 Qc = Matrix6::Zero();
    Qc.bottomRightCorner<3, 3>() = psd * Eigen::Matrix3d::Identity();
    return Qc;
}

/// System matrix of the errors of (attitude, rate), target axes.
Matrix6 rotation_rates(const Eigen::Vector3d& w) {
    Matrix6 F = Matrix6::Zero();
    F.topLeftCorner<3, 3>() = -skew(w);
    F.topRightCorner<3, 3>().setIdentity();
    return F;
}

void turn_steadily(const MotionModel& model, double dt_s, RelativeState& state, Discrete<6>& d) {
    d = discretise<6>(rotation_rates(to_eigen(state.rate_rad_s)), driven(model.angular_acceleration_psd), dt_s);
    state.q_frame_target = state.q_frame_target * exp_rotation(dt_s * state.rate_rad_s);
}

void tumble(const MotionModel& model, double dt_s, RelativeState& state, Discrete<6>& d) {
    const Eigen::Matrix3d& J = *model.inertia_kg_m2;
    const Eigen::Matrix3d J_inverse = J.inverse();
    const int steps = 1 + static_cast<int>(norm(state.rate_rad_s) * dt_s / kTumbleStepRad);
    const double h = dt_s / steps;
    d.transition.setIdentity();
    d.noise.setZero();
    Eigen::Vector3d w = to_eigen(state.rate_rad_s);
    for (int i = 0; i < steps; ++i) {
        const RotationStep turned = rotation_step(J, J_inverse, Eigen::Vector3d::Zero(), w, h);
        const Eigen::Vector3d& middle = turned.mid_rate_rad_s;
        Matrix6 F = rotation_rates(middle);
        F.bottomRightCorner<3, 3>() = J_inverse * (skew(J * middle) - skew(middle) * J);
        const Discrete<6> step = discretise<6>(F, driven(model.angular_acceleration_psd), h);
        d.transition = (step.transition * d.transition).eval();
        d.noise = (step.transition * d.noise * step.transition.transpose() + step.noise).eval();
        state.q_frame_target = state.q_frame_target * exp_rotation(to_vec3(turned.turn_rad));
        w = turned.rate_rad_s;
    }
    state.rate_rad_s = to_vec3(w);
}

}  // namespace

RotationStep rotation_step(const Eigen::Matrix3d& inertia, const Eigen::Matrix3d& inverse,
                           const Eigen::Vector3d& torque_n_m, const Eigen::Vector3d& w, double h) {
    const auto f = [&](const Eigen::Vector3d& rate) -> Eigen::Vector3d {
        return inverse * (torque_n_m - rate.cross(inertia * rate));
    };
    const Eigen::Vector3d k1 = f(w), k2 = f(w + 0.5 * h * k1), k3 = f(w + 0.5 * h * k2), k4 = f(w + h * k3);
    const Eigen::Vector3d next = w + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    const Eigen::Vector3d middle = 0.5 * (w + next) + h / 8 * (k1 - f(next));  // cubic through both ends
    return {next, middle, h / 6 * (w + 4 * middle + next) + h * h / 12 * w.cross(next)};
}

RelativeState displaced(const RelativeState& s, const Vector12& e) {
    return {s.position_m + Vec3{e[0], e[1], e[2]}, s.velocity_m_s + Vec3{e[3], e[4], e[5]},
            normalized(s.q_frame_target * exp_rotation({e[6], e[7], e[8]})),
            s.rate_rad_s + Vec3{e[9], e[10], e[11]}};
}

Vector12 error_between(const RelativeState& from, const RelativeState& to) {
    Vector12 e;
    e << to_eigen(to.position_m - from.position_m), to_eigen(to.velocity_m_s - from.velocity_m_s),
        to_eigen(rotation_vector(conjugate(from.q_frame_target) * to.q_frame_target)),
        to_eigen(to.rate_rad_s - from.rate_rad_s);
    return e;
}

double normalised_error_squared(const Vector12& error, const Matrix12& covariance) {
    const Eigen::LLT<Matrix12> factor(covariance);
    if (factor.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    return factor.matrixL().solve(error).squaredNorm();
}

Status check(const MotionModel& m) {
    const auto wrong = [](const std::string& name, double value, const char* expected) {
        return Error{name + " = " + std::to_string(value) + ": expected " + expected};
    };
    if (!(m.orbit_rate_rad_s >= 0 && std::isfinite(m.orbit_rate_rad_s)))
        return wrong("orbit_rate_rad_s", m.orbit_rate_rad_s, "0 (a free body) or more");
    if (!(m.acceleration_psd >= 0 && std::isfinite(m.acceleration_psd)))
        return wrong("acceleration_psd", m.acceleration_psd, "0 m^2 s^-3 or more");
    if (!(m.angular_acceleration_psd >= 0 && std::isfinite(m.angular_acceleration_psd)))
        return wrong("angular_acceleration_psd", m.angular_acceleration_psd, "0 rad^2 s^-3 or more");
    if (m.ground && !(is_finite(m.ground->gravity_m_s2) && m.ground->gradient_s2.allFinite()))
        return Error{"ground: expected finite numbers"};
    if (m.inertia_kg_m2) {
        const Eigen::Matrix3d& J = *m.inertia_kg_m2;
        if (!J.allFinite() || !J.isApprox(J.transpose(), 1e-9) ||
            Eigen::LLT<Eigen::Matrix3d>(J).info() != Eigen::Success)
            return Error{"inertia_kg_m2: expected a symmetric, positive definite matrix"};
    }
    return Ok{};
}

void propagate(const MotionModel& model, double dt_s, const Vec3& acceleration_m_s2, RelativeState& state,
               Matrix12& covariance) {
    if (dt_s <= 0) return;
    const double n = model.orbit_rate_rad_s;
    const Discrete<6> moving = discretise<6>(translation_rates(model), driven(model.acceleration_psd), dt_s);
    Vector6 x, driving = Vector6::Zero();
    x << to_eigen(state.position_m), to_eigen(state.velocity_m_s);
    driving.tail<3>() = to_eigen(acceleration_m_s2);
    if (model.ground)
        driving.tail<3>() -= to_eigen(model.ground->gravity_m_s2);  // the chaser falls, the target does not
    x = (moving.transition * x + moving.integral * driving).eval();
    state.position_m = {x[0], x[1], x[2]};
    state.velocity_m_s = {x[3], x[4], x[5]};

    Discrete<6> turning;
    if (model.inertia_kg_m2)
        tumble(model, dt_s, state, turning);
    else
        turn_steadily(model, dt_s, state, turning);
    state.q_frame_target = normalized(exp_rotation({0, 0, -n * dt_s}) * state.q_frame_target);

    Matrix12 transition = Matrix12::Zero();
    transition.topLeftCorner<6, 6>() = moving.transition;
    transition.bottomRightCorner<6, 6>() = turning.transition;
    covariance = (transition * covariance * transition.transpose()).eval();
    covariance.topLeftCorner<6, 6>() += moving.noise;
    covariance.bottomRightCorner<6, 6>() += turning.noise;
    covariance = (0.5 * (covariance + covariance.transpose())).eval();
}

Matrix6 clohessy_wiltshire_transition(double n, double t) {
    const double s = std::sin(n * t), c = std::cos(n * t);
    Matrix6 T;
    T << 4 - 3 * c, 0, 0, s / n, 2 * (1 - c) / n, 0,                          //
        6 * (s - n * t), 1, 0, -2 * (1 - c) / n, (4 * s - 3 * n * t) / n, 0,  //
        0, 0, c, 0, 0, s / n,                                                 //
        3 * n * s, 0, 0, c, 2 * s, 0,                                         //
        -6 * n * (1 - c), 0, 0, -2 * s, 4 * c - 3, 0,                         //
        0, 0, -n * s, 0, 0, c;
    return T;
}

}  // namespace narpa
