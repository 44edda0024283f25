#include "rehearsal/navigation/guidance/flight_control.h"

#include <algorithm>
#include <cmath>

namespace narpa::rehearsal {
namespace {

/// Share of the torque that may go into stopping a rotation.
constexpr double kShareToStop = 0.5;

std::array<PulseAxis, 3> axes(double strength, const Thrusters& thrusters, double period_s) {
    const PulseAxis axis(strength * thrusters.min_on_s, strength * period_s);
    return {axis, axis, axis};
}

double angle_between_directions(const Vec3& a, const Vec3& b) {
    return std::atan2(norm(cross(a, b)), dot(a, b));
}

Vec3 modulate(std::array<PulseAxis, 3>& axes, const Vec3& wanted) {
    return {axes[0].modulate(wanted.x), axes[1].modulate(wanted.y), axes[2].modulate(wanted.z)};
}

/// A pulse at the start of the period moves a body further than the same impulse spread over the period. Returns
/// the velocity by which the initial velocity is reduced. `steady`: mean acceleration; `most`: acceleration during
/// the pulse.
Vec3 push_lag(const Vec3& steady, double most, double period_s) {
    const double on = std::min(1.0, norm(steady) / most);
    return (0.5 * (1 - on) * period_s) * steady;
}

double max_turn_rad_s(const Scenario& s, const SampledGains& gains) {
    const double least = s.thrusters.torque_n_m / s.chaser.inertia_kg_m2.diagonal().maxCoeff();
    return std::min(kDegree * s.control.turn_deg_s, kShareToStop * least / gains.velocity_s);
}

}  // namespace

SampledGains SampledGains::of(double bandwidth_rad_s, double damping, double period_s) {
    // z = exp(T (-d w +- i w sqrt(1 - d^2))): their sum and product are the closed loop's trace and determinant.
    const double decay = std::exp(-damping * bandwidth_rad_s * period_s);
    const double off = bandwidth_rad_s * period_s * std::sqrt(std::abs(1 - damping * damping));
    const double trace = 2 * decay * (damping <= 1 ? std::cos(off) : std::cosh(off));
    const double determinant = decay * decay;
    return {(1 + determinant - trace) / (period_s * period_s), (1 - determinant) / period_s};
}

double PulseAxis::modulate(double wanted) noexcept {
    const double all = wanted + saved_;
    if (std::abs(all) < least_) {
        saved_ = all;
        return 0;
    }
    saved_ = 0;  // saturation is not carried over: feedback corrects it
    return std::clamp(all, -most_, most_);
}

FlightControl::FlightControl(const Scenario& s)
    : orbit_(s.orbit),
      engine_(s.engine),
      target_(s.target),
      chaser_(s.chaser),
      period_s_(s.navigation.period_s),
      position_(SampledGains::of(s.control.bandwidth_rad_s, s.control.damping, period_s_)),
      attitude_(SampledGains::of(s.control.attitude_bandwidth_rad_s, s.control.damping, period_s_)),
      acceleration_most_m_s2_(s.thrusters.force_n / s.chaser.mass_kg),
      turn_acceleration_most_rad_s2_(s.thrusters.torque_n_m / s.chaser.inertia_kg_m2.diagonal().maxCoeff()),
      turn_most_rad_s_(max_turn_rad_s(s, attitude_)),
      force_(axes(s.thrusters.force_n, s.thrusters, period_s_)),
      torque_(axes(s.thrusters.torque_n_m, s.thrusters, period_s_)) {}

void FlightControl::reset() noexcept {
    for (PulseAxis& a : force_) a.reset();
    for (PulseAxis& a : torque_) a.reset();
}

Impulses FlightControl::step(double t_s, const RelativeMotion& m, const Reference& reference) {
    if (engine_) return step_with_engine(t_s, m, reference);
    const Vec3 turn = angular_acceleration(m, reference, q_world_wanted(m, reference));
    const Vec3 push = conjugate(m.q_world_chaser) * acceleration(t_s, m, reference, turn);
    const Vec3 momentum = to_vec3(chaser_.inertia_kg_m2 * to_eigen(m.chaser_rate_rad_s));
    const Vec3 torque = to_vec3(chaser_.inertia_kg_m2 * to_eigen(turn)) + cross(m.chaser_rate_rad_s, momentum);
    return {modulate(force_, chaser_.mass_kg * period_s_ * push), modulate(torque_, period_s_ * torque)};
}

Quat FlightControl::q_world_wanted(const RelativeMotion& m, const Reference& reference) const {
    return m.q_world_target * target_.T_body_port.q * reference.q_port_chaser_port *
           conjugate(chaser_.T_body_port.q);
}

/// The force is the engine's along its axis, which is rotated to the wanted direction, up to the largest tilt.
Impulses FlightControl::step_with_engine(double t_s, const RelativeMotion& m, const Reference& reference) {
    const Quat q_world_upright = q_world_wanted(m, reference);
    // As if upright: a rotation that the engine needs must not make the controller move the feet aside.
    RelativeMotion upright = m;
    upright.q_world_chaser = q_world_upright;
    upright.chaser_rate_rad_s = {};
    const Vec3 wanted = acceleration(t_s, upright, reference, {});
    Vec3 engine_axis;
    engine_axis[engine_->axis()] = engine_->sign();
    const Vec3 up = q_world_upright * engine_axis;
    const double tilt = std::min(angle_between_directions(up, wanted), kDegree * engine_->tilt_most_deg);
    const Vec3 about = cross(up, wanted);
    const Quat tilted = norm(about) > 0 ? exp_rotation((tilt / norm(about)) * about) : Quat{};

    const Vec3 turn = angular_acceleration(m, reference, normalized(tilted * q_world_upright));
    const Vec3 momentum = to_vec3(chaser_.inertia_kg_m2 * to_eigen(m.chaser_rate_rad_s));
    const Vec3 torque = to_vec3(chaser_.inertia_kg_m2 * to_eigen(turn)) + cross(m.chaser_rate_rad_s, momentum);

    const Vec3 force = chaser_.mass_kg * (conjugate(m.q_world_chaser) * wanted);
    Vec3 across = period_s_ * force;
    across[engine_->axis()] = 0;
    Vec3 impulse = modulate(force_, across);
    impulse[engine_->axis()] =
        engine_->sign() * period_s_ *
        std::clamp(engine_->sign() * force[engine_->axis()], engine_->least_n, engine_->most_n);
    return {impulse, modulate(torque_, period_s_ * torque)};
}

/// In the chaser's body axes.
Vec3 FlightControl::angular_acceleration(const RelativeMotion& m, const Reference& reference,
                                         const Quat& q_world_wanted) const {
    const Quat q_world_port = m.q_world_target * target_.T_body_port.q;
    const Vec3 port_rate = m.q_world_target * m.target_rate_rad_s;
    const Vec3 turning = q_world_port * reference.rate_rad_s;
    const Vec3 wanted_rate = port_rate + turning;
    const Vec3 wanted_acceleration =
        q_world_port * reference.angular_acceleration_rad_s2 + cross(port_rate, turning);

    const Quat q_chaser_world = conjugate(m.q_world_chaser);
    Vec3 error = rotation_vector(q_chaser_world * q_world_wanted);
    const double most = turn_most_rad_s_ * attitude_.velocity_s / attitude_.position_s2;
    if (norm(error) > most) error = error * (most / norm(error));
    const Vec3 steady = q_chaser_world * wanted_acceleration;
    const Vec3 rate = q_chaser_world * wanted_rate - push_lag(steady, turn_acceleration_most_rad_s2_, period_s_);
    return attitude_.position_s2 * error + attitude_.velocity_s * (rate - m.chaser_rate_rad_s) + steady;
}

/// Acceleration of the centre of mass by thrust, world axes.
Vec3 FlightControl::acceleration(double t_s, const RelativeMotion& m, const Reference& reference,
                                 const Vec3& angular_acceleration_rad_s2) const {
    // Reference motion of the port about the target's centre of mass, inertial axes.
    const Rigid3 T_world_port = Rigid3{m.q_world_target, {}} * port_from_mass(target_);
    const Vec3 w = m.q_world_target * m.target_rate_rad_s;
    const Vec3 wanted = T_world_port * reference.position_m;
    const Vec3 wanted_along = T_world_port.q * reference.velocity_m_s;
    const Vec3 wanted_velocity = wanted_along + cross(w, wanted);
    const Vec3 wanted_acceleration =
        T_world_port.q * reference.acceleration_m_s2 + 2 * cross(w, wanted_along) + cross(w, cross(w, wanted));
    // Actual motion of the port due to the chaser's rotation.
    const Vec3 arm = m.q_world_chaser * port_from_mass(chaser_).t;
    const Vec3 turn = m.q_world_chaser * m.chaser_rate_rad_s;
    const Vec3 by_turning =
        cross(m.q_world_chaser * angular_acceleration_rad_s2, arm) + cross(turn, cross(turn, arm));
    const Vec3 steady = wanted_acceleration - gravity_difference_m_s2(orbit_, t_s, m.position_m);
    const Vec3 lag = engine_ ? Vec3{} : push_lag(steady, acceleration_most_m_s2_, period_s_);
    const Vec3 velocity = wanted_velocity - lag;
    return position_.position_s2 * (wanted - (m.position_m + arm)) +
           position_.velocity_s * (velocity - (m.velocity_m_s + cross(turn, arm))) + steady - by_turning;
}

}  // namespace narpa::rehearsal
