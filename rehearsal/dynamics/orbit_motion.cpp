#include "rehearsal/dynamics/orbit_motion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "estimator/filter/motion_model.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa::rehearsal {
namespace {

constexpr double kLongestStepS = 1;

Translation free_motion(double dt, const Vec3& a, const Translation& x) {
    return {x.position_m + dt * x.velocity_m_s + (0.5 * dt * dt) * a, x.velocity_m_s + dt * a};
}

/// Motion from rest at the origin under the constant acceleration a, LVLH axes.
Translation clohessy_wiltshire_push(double n, double t, const Vec3& a) {
    const double nt = n * t, s = std::sin(nt), half = std::sin(0.5 * nt);
    const double versine = 2 * half * half;  // 1 - cos
    const double lag = nt - s;
    return {{(a.x * versine + 2 * a.y * lag) / (n * n),
             (-2 * a.x * lag + 4 * a.y * versine) / (n * n) - 1.5 * a.y * t * t, a.z * versine / (n * n)},
            {(a.x * s + 2 * a.y * versine) / n, (-2 * a.x * versine + 4 * a.y * s) / n - 3 * a.y * t, a.z * s / n}};
}

Translation clohessy_wiltshire(const Orbit& orbit, double t, double dt, const Vec3& a, const Translation& x) {
    const double n = orbit.rate_rad_s();
    const Vec3 rate{0, 0, n};
    const Quat q_lvlh_world = conjugate(orbit.q_world_frame(t));
    const Vec3 position = q_lvlh_world * x.position_m;
    const Vec3 velocity = q_lvlh_world * x.velocity_m_s - cross(rate, position);
    Vector6 state;
    state << to_eigen(position), to_eigen(velocity);
    state = (clohessy_wiltshire_transition(n, dt) * state).eval();
    const Translation pushed = clohessy_wiltshire_push(n, dt, conjugate(orbit.q_world_frame(t + 0.5 * dt)) * a);
    const Vec3 position_then = Vec3{state[0], state[1], state[2]} + pushed.position_m;
    const Vec3 velocity_then = Vec3{state[3], state[4], state[5]} + pushed.velocity_m_s;
    const Quat q_world_frame = orbit.q_world_frame(t + dt);
    return {q_world_frame * position_then, q_world_frame * (velocity_then + cross(rate, position_then))};
}

/// Gravity at the chaser minus gravity at the target, which is at R from the attractor.
Vec3 gravity_difference(double mu, const Vec3& R, const Vec3& r) {
    const double square = dot(R, R);
    const double q = dot(r, r + 2.0 * R) / square;
    const double root = std::sqrt(1 + q) * (1 + q);
    const double f = -q * (3 + q * (3 + q)) / (root * (1 + root));  // (1 + q)^-3/2 - 1
    return (-mu / (square * std::sqrt(square))) * (r + f * (R + r));
}

/// `rates(after_s, state)`: derivatives at after_s from the start of the step h.
template <class Rates>
Translation runge_kutta(double h, const Translation& x, const Rates& rates) {
    const auto moved = [&](const Translation& rate, double by) {
        return Translation{x.position_m + by * rate.position_m, x.velocity_m_s + by * rate.velocity_m_s};
    };
    const Translation k1 = rates(0, x), k2 = rates(0.5 * h, moved(k1, 0.5 * h));
    const Translation k3 = rates(0.5 * h, moved(k2, 0.5 * h)), k4 = rates(h, moved(k3, h));
    return {x.position_m + h / 6 * (k1.position_m + 2.0 * k2.position_m + 2.0 * k3.position_m + k4.position_m),
            x.velocity_m_s +
                h / 6 * (k1.velocity_m_s + 2.0 * k2.velocity_m_s + 2.0 * k3.velocity_m_s + k4.velocity_m_s)};
}

Translation two_body_step(const Orbit& orbit, double t, double h, const Vec3& a, const Translation& x) {
    return runge_kutta(h, x, [&](double after_s, const Translation& s) {
        const Vec3 R = orbit.q_world_frame(t + after_s) * Vec3{orbit.radius_m, 0, 0};
        return Translation{s.velocity_m_s, gravity_difference(orbit.mu_m3_s2, R, s.position_m) + a};
    });
}

/// One step over the ground of a rotating planet.
Translation surface_step(const Orbit& orbit, double t, double h, const Vec3& a, const Translation& x) {
    return runge_kutta(h, x, [&](double after_s, const Translation& s) {
        return Translation{s.velocity_m_s, orbit.relative_free_fall_m_s2(t + after_s, s.position_m) + a};
    });
}

template <class Step>
Translation in_steps(const Step& step, const Orbit& orbit, double t, double dt, const Vec3& a, Translation x) {
    const int steps = std::max(1, static_cast<int>(std::ceil(std::abs(dt) / kLongestStepS)));
    const double h = dt / steps;
    for (int i = 0; i < steps; ++i) x = step(orbit, t + i * h, h, a, x);
    return x;
}

}  // namespace

Translation propagated(const Orbit& orbit, double t_s, double dt_s, const Vec3& acceleration_m_s2,
                       const Translation& from) {
    switch (orbit.model) {
        case Orbit::Model::free: break;
        case Orbit::Model::clohessy_wiltshire: return clohessy_wiltshire(orbit, t_s, dt_s, acceleration_m_s2, from);
        case Orbit::Model::two_body: return in_steps(two_body_step, orbit, t_s, dt_s, acceleration_m_s2, from);
        case Orbit::Model::surface: return in_steps(surface_step, orbit, t_s, dt_s, acceleration_m_s2, from);
    }
    return free_motion(dt_s, acceleration_m_s2, from);
}

Motion attractor_motion(const Orbit& orbit, const Quat& q_world_attractor, double t_s) {
    const Quat q_world_frame = orbit.q_world_frame(t_s);
    return {{q_world_attractor, q_world_frame * Vec3{-orbit.radius_m, 0, 0}},
            q_world_frame * Vec3{0, -orbit.radius_m * orbit.rate_rad_s(), 0},
            {}};
}

namespace {

constexpr double kLargestTurnRad = 0.005;

}  // namespace

RigidBody::RigidBody(const Eigen::Matrix3d& inertia_kg_m2)
    : inertia_(inertia_kg_m2), inverse_(inertia_kg_m2.inverse()) {}

Attitude RigidBody::turned(Attitude from, const Vec3& torque_n_m, double dt_s) const {
    const Eigen::Vector3d torque = to_eigen(torque_n_m);
    Eigen::Vector3d w = to_eigen(from.rate_rad_s);
    const double turn_rad = w.norm() * dt_s + 0.5 * (inverse_ * torque).norm() * dt_s * dt_s;
    const int steps = 1 + static_cast<int>(turn_rad / kLargestTurnRad);
    const double h = dt_s / steps;
    for (int i = 0; i < steps; ++i) {
        const RotationStep step = rotation_step(inertia_, inverse_, torque, w, h);
        from.q_world_body = from.q_world_body * exp_rotation(to_vec3(step.turn_rad));
        w = step.rate_rad_s;
    }
    return {normalized(from.q_world_body), to_vec3(w)};
}

}  // namespace narpa::rehearsal
