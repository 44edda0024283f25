#include "rehearsal/dynamics/simulation.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "base/time.h"
#include "protocols/can/messages.h"
#include "rehearsal/dynamics/thruster_model.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kLongestStepNs = 50'000'000;  // limits the error from forces that rotate with the body
constexpr double kPortRadiusM = 1;                   // beyond this lateral distance the ports miss each other
constexpr double kRestitution = 0.3;
constexpr std::int64_t kAfterCaptureNs = 2'000'000'000, kAfterBounceNs = 10'000'000'000;
constexpr double kLeftDistances = 2;   // a chaser further away than this, over its start distance, has left
constexpr double kGravity0 = 9.80665;  // standard gravity, m/s^2, for specific impulses

// With feet on the ground: the period of a lander's springs is a few hundred of these steps.
constexpr std::int64_t kContactStepNs = 1'000'000;
constexpr double kNearGroundM = 0.1;
constexpr double kStillM_s = 0.02, kStillRad_s = 0.2 * kDegree;
constexpr std::int64_t kStillNs = 1'000'000'000, kAfterLandingNs = 1'000'000'000;

/// A motion quantised as by a pose command; unchanged if it exceeds the command's range.
Motion as_transmitted(const Motion& motion) {
    PoseCommand command{0, 0, motion};
    PoseDecoder decoder(0);
    if (FrameSet frames; encode(command, 0, true, frames))
        for (const CanFrame& frame : frames) (void)decoder.accept(frame, 0, command);
    return command.motion;
}

}  // namespace

Simulation::Simulation(const Scenario& scenario, std::uint64_t seed, std::shared_ptr<const Terrain> terrain)
    : scenario_(scenario),
      target_body_(scenario.target.inertia_kg_m2),
      chaser_body_(scenario.chaser.inertia_kg_m2),
      thrusters_(scenario, seed),
      sensor_(engine(seed, Stream::attitude_sensor)) {
    if (scenario.gear && terrain) ground_.emplace(*scenario.gear, std::move(terrain));
    place_bodies(seed);
}

/// Places the target as in the scene, and the chaser at the nominal start plus its dispersion.
void Simulation::place_bodies(std::uint64_t seed) {
    std::mt19937_64 draws = engine(seed, Stream::start);
    draws_.position = draw_normal(draws);
    draws_.velocity = draw_normal(draws);
    draws_.attitude = draw_normal(draws);
    draws_.rate = draw_normal(draws);
    const auto off = [](const Vec3& sigma, const Vec3& draw) {
        return Vec3{sigma.x * draw.x, sigma.y * draw.y, sigma.z * draw.z};
    };

    state_.target.q_world_body = normalized(scenario_.q_world_target);
    state_.target.rate_rad_s = kDegree * scenario_.target_motion.rate_deg_s;
    if (scenario_.target_motion.with_lvlh) {
        const Vec3 orbit_rate = scenario_.orbit.q_world_frame(0) * Vec3{0, 0, scenario_.orbit.rate_rad_s()};
        state_.target.rate_rad_s += conjugate(state_.target.q_world_body) * orbit_rate;
    }

    const Start& s = scenario_.start;
    PortState port;
    port.T_port_chaser_port.t = s.position_m + off(s.position_sigma_m, draws_.position);
    port.velocity_m_s = s.velocity_m_s + off(s.velocity_sigma_m_s, draws_.velocity);
    port.T_port_chaser_port.q =
        T_port_docked().q * exp_rotation(kDegree * (s.attitude_deg + off(s.attitude_sigma_deg, draws_.attitude)));
    const Vec3 rate_body = kDegree * (s.rate_deg_s + off(s.rate_sigma_deg_s, draws_.rate));
    port.rate_rad_s = conjugate(scenario_.chaser.T_body_port.q) * rate_body;
    const Motion chaser = chaser_motion(port, scenario_.target, target_motion(state_), scenario_.chaser);
    const Vec3& centre = scenario_.chaser.centre_of_mass_m;
    state_.mass_kg = scenario_.chaser.mass_kg;
    state_.chaser = {chaser.T_world_body.q, chaser.rate_rad_s};
    state_.translation = {chaser.T_world_body * centre,
                          chaser.velocity_m_s + chaser.T_world_body.q * cross(chaser.rate_rad_s, centre)};
    change_target_rate(-1, 0);
}

bool Simulation::apply(const ActuatorCommand& command) {
    if (effects_at(scenario_.faults, t_ns()).commands_lost) return false;
    command_ = command;
    thrusters_.fire(command, t_ns());
    return true;
}

/// Advances in steps over which forces are constant.
void Simulation::advance_to(std::int64_t t_ns) {
    assert(t_ns >= state_.t_ns);
    if (ground_) return advance_lander(t_ns);
    if (at_contact_) rebound_or_hold();
    while (state_.t_ns < t_ns) {
        const std::int64_t from_ns = state_.t_ns;
        const std::int64_t until_ns =
            std::min({t_ns, from_ns + kLongestStepNs, thrusters_.next_change_ns(from_ns)});
        const Loads loads = thrusters_.loads(from_ns);
        State next = after(state_, loads, until_ns - from_ns);
        if (phase_ == DynamicsPhase::flying && passes_plane(state_, next)) {
            const State met = at_plane(loads, until_ns - from_ns, t_ns);
            if (ports_meet(met)) {
                touch(met, loads);
                return;
            }
        }
        if (phase_ == DynamicsPhase::bounced && port(next).position_m().x <= 0 && ports_meet(next)) rebound(next);
        fire_for(loads, until_ns - from_ns);
        state_ = next;
        change_target_rate(from_ns, until_ns);
    }
}

/// Applies the changes of the target's rate by faults that start or end in (after_ns, until_ns].
void Simulation::change_target_rate(std::int64_t after_ns, std::int64_t until_ns) {
    state_.target.rate_rad_s += effects_at(scenario_.faults, until_ns).target_rate_rad_s -
                                effects_at(scenario_.faults, after_ns).target_rate_rad_s;
}

void Simulation::fire_for(const Loads& loads, std::int64_t dt_ns) {
    fired_.force_n += to_seconds(dt_ns) * loads.force_n;
    fired_.torque_n_m += to_seconds(dt_ns) * loads.torque_n_m;
}

// --- Motion ---------------------------------------------------------------------------------------------------

Simulation::State Simulation::after(const State& from, const Loads& loads, std::int64_t dt_ns) const {
    const double dt_s = to_seconds(dt_ns);
    State to;
    to.t_ns = from.t_ns + dt_ns;
    to.mass_kg = from.mass_kg;
    if (const auto& e = scenario_.engine; e && e->specific_impulse_s > 0)
        to.mass_kg -=
            std::max(0.0, e->sign() * loads.force_n[e->axis()]) * dt_s / (e->specific_impulse_s * kGravity0);
    to.target = target_after(from, dt_s);
    if (T_held_) {
        to.chaser.q_world_body = normalized(to.target.q_world_body * T_held_->q);
        to.chaser.rate_rad_s = conjugate(T_held_->q) * to.target.rate_rad_s;
        to.translation = {to.target.q_world_body * T_held_->t,
                          to.target.q_world_body * cross(to.target.rate_rad_s, T_held_->t)};
        return to;
    }
    to.chaser = chaser_body_.turned(from.chaser, loads.torque_n_m, dt_s);
    Vec3 acceleration_m_s2;
    if (loads.force_n != Vec3{}) {
        const Attitude middle = chaser_body_.turned(from.chaser, loads.torque_n_m, 0.5 * dt_s);
        acceleration_m_s2 = middle.q_world_body * loads.force_n / from.mass_kg;
    }
    to.translation = propagated(scenario_.orbit, to_seconds(from.t_ns), dt_s, acceleration_m_s2, from.translation);
    return to;
}

/// With LVLH: constant rate relative to LVLH; otherwise free rotation.
Attitude Simulation::target_after(const State& from, double dt_s) const {
    if (!scenario_.target_motion.with_lvlh) return target_body_.turned(from.target, {}, dt_s);
    const Vec3 orbit_rate{0, 0, scenario_.orbit.rate_rad_s()};
    const Quat q_lvlh_body =
        conjugate(scenario_.orbit.q_world_frame(to_seconds(from.t_ns))) * from.target.q_world_body;
    const Vec3 rate = from.target.rate_rad_s - conjugate(q_lvlh_body) * orbit_rate;
    const Quat q_lvlh_then = q_lvlh_body * exp_rotation(dt_s * rate);
    return {normalized(scenario_.orbit.q_world_frame(to_seconds(from.t_ns) + dt_s) * q_lvlh_then),
            rate + conjugate(q_lvlh_then) * orbit_rate};
}

Motion Simulation::target_motion(const State& state) const {
    const auto& [q, rate] = state.target;
    const Vec3& centre = scenario_.target.centre_of_mass_m;
    return {{q, -(q * centre)}, -(q * cross(rate, centre)), rate};
}

Motion Simulation::chaser_motion_of(const State& state) const {
    const auto& [q, rate] = state.chaser;
    const Vec3& centre = scenario_.chaser.centre_of_mass_m;
    return {{q, state.translation.position_m - q * centre},
            state.translation.velocity_m_s - q * cross(rate, centre),
            rate};
}

PortState Simulation::port(const State& state) const {
    return port_state(scenario_.target, target_motion(state), scenario_.chaser, chaser_motion_of(state));
}

// --- Contact --------------------------------------------------------------------------------------------------

bool Simulation::passes_plane(const State& before, const State& then) const {
    return port(before).position_m().x > 0 && port(then).position_m().x <= 0;
}

/// State at the first nanosecond at which the chaser's port has reached the plane, before `before_ns`.
Simulation::State Simulation::at_plane(const Loads& loads, std::int64_t dt_ns, std::int64_t before_ns) const {
    std::int64_t not_yet = 0, reached = dt_ns;
    while (reached - not_yet > 1) {
        const std::int64_t middle = not_yet + (reached - not_yet) / 2;
        (port(after(state_, loads, middle)).position_m().x > 0 ? not_yet : reached) = middle;
    }
    return after(state_, loads, std::min(reached, before_ns - 1 - state_.t_ns));
}

bool Simulation::ports_meet(const State& state) const {
    const PortState p = port(state);
    return p.lateral_m() <= kPortRadiusM && p.closing_m_s() > 0;
}

/// Capture is decided on the poses as quantised on CAN: the judge, which has only these, then decides alike at the
/// limits.
void Simulation::touch(const State& met, const Loads& loads) {
    fire_for(loads, met.t_ns - state_.t_ns);
    state_ = met;
    const PortState on_bus = port_state(scenario_.target, as_transmitted(target_motion(met)), scenario_.chaser,
                                        as_transmitted(chaser_motion_of(met)));
    const bool captured = within(scenario_.gates.contact.value_or(CaptureEnvelope{}), on_bus);
    contact_ = ContactEvent{met.t_ns, port(), captured};
    phase_ = captured ? DynamicsPhase::captured : DynamicsPhase::bounced;
    at_contact_ = true;
}

void Simulation::rebound_or_hold() {
    at_contact_ = false;
    if (phase_ != DynamicsPhase::captured) return rebound(state_);
    hold();
}

// --- Landing --------------------------------------------------------------------------------------------------

std::optional<double> Simulation::clearance_m() const {
    if (!ground_) return std::nullopt;
    return ground_->clearance_m(port());
}

/// Like advance_to, but in short steps if the feet may touch the ground within a long one.
void Simulation::advance_lander(std::int64_t t_ns) {
    while (state_.t_ns < t_ns) {
        const std::int64_t from_ns = state_.t_ns;
        Loads loads = thrusters_.loads(from_ns);
        std::int64_t step_ns = kLongestStepNs;
        if (!T_held_) {
            const PortState p = port();
            const double reach_m = kNearGroundM + to_seconds(kLongestStepNs) * 2 * norm(p.velocity_m_s);
            if (ground_->clearance_m(p) < reach_m) {
                step_ns = kContactStepNs;
                const Loads pushed = ground_loads();
                if (judge_landing(deepest_m_)) return;
                loads.force_n += pushed.force_n, loads.torque_n_m += pushed.torque_n_m;
            }
        }
        const std::int64_t until_ns = std::min({t_ns, from_ns + step_ns, thrusters_.next_change_ns(from_ns)});
        State next = after(state_, loads, until_ns - from_ns);
        fire_for(thrusters_.loads(from_ns), until_ns - from_ns);
        state_ = next;
        change_target_rate(from_ns, until_ns);
    }
}

/// Forces of the ground on the chaser, body axes, about its centre of mass.
Loads Simulation::ground_loads() {
    const PortState p = port();
    const GroundForces f = ground_->press(p);
    deepest_m_ = f.deepest_m;
    const Quat q_body_site = scenario_.chaser.T_body_port.q * conjugate(p.T_port_chaser_port.q);
    const Vec3 force = q_body_site * f.force_n;
    const Vec3 arm = scenario_.chaser.T_body_port.t - scenario_.chaser.centre_of_mass_m;
    return {force, q_body_site * f.torque_n_m + cross(arm, force)};
}

/// Returns true if the phase changes.
bool Simulation::judge_landing(double deepest_m) {
    const PortState p = port();
    if (phase_ == DynamicsPhase::flying) {
        if (deepest_m <= 0) return false;
        contact_ = ContactEvent{state_.t_ns, p, false};
        phase_ = DynamicsPhase::touched_down;
        return true;
    }
    if (deepest_m > scenario_.gear->stroke_m || p.pitch_yaw_rad() > kDegree * scenario_.gear->tipped_deg) {
        phase_ = DynamicsPhase::crashed;
        hold();
        return true;
    }
    const bool still = deepest_m > 0 && norm(p.velocity_m_s) < kStillM_s && norm(p.rate_rad_s) < kStillRad_s;
    if (!still) still_ns_.reset();
    if (still && !still_ns_) still_ns_ = state_.t_ns;
    if (!still || state_.t_ns - *still_ns_ < kStillNs) return false;
    phase_ = DynamicsPhase::landed;
    contact_->captured = true;
    hold();
    return true;
}

/// Fixes the chaser to the target from now on.
void Simulation::hold() {
    settled_ns_ = state_.t_ns;
    const Quat q_target_world = conjugate(state_.target.q_world_body);
    T_held_ = Rigid3{q_target_world * state_.chaser.q_world_body, q_target_world * state_.translation.position_m};
}

/// Reverses the port's velocity along the target port's axis, by an impulse at the chaser's centre of mass.
void Simulation::rebound(State& state) const {
    const Vec3 axis_world = state.target.q_world_body * scenario_.target.T_body_port.q * Vec3{1, 0, 0};
    state.translation.velocity_m_s -= (1 + kRestitution) * port(state).velocity_m_s.x * axis_world;
}

// --- Outputs -----------------------------------------------------------------------------------------

AttitudeReport Simulation::measure_attitude() {
    const AttitudeSensor& s = scenario_.attitude_sensor;
    const Quat bias = effects_at(scenario_.faults, t_ns()).q_attitude_bias;
    const Vec3 attitude = (s.attitude_sigma_deg * kDegree) * draw_normal(sensor_);
    const Vec3 rate = (s.rate_sigma_deg_s * kDegree) * draw_normal(sensor_);
    AttitudeReport report;
    report.t_ns = t_ns();
    report.q_world_chaser = normalized(state_.chaser.q_world_body * bias * exp_rotation(attitude));
    report.rate_rad_s = state_.chaser.rate_rad_s + rate;
    return report;
}

Truth Simulation::truth() const {
    return {attractor_motion(scenario_.orbit, scenario_.q_world_attractor, to_seconds(t_ns())),
            target_motion(state_), chaser_motion_of(state_)};
}

PortState Simulation::port() const {
    return port(state_);
}

Ending Simulation::ending() const {
    if (phase_ == DynamicsPhase::landed || phase_ == DynamicsPhase::crashed) {
        if (t_ns() < settled_ns_ + kAfterLandingNs) return Ending::not_yet;
        return phase_ == DynamicsPhase::landed ? Ending::landed : Ending::crashed;
    }
    if (!ground_ && contact_ && t_ns() >= contact_->t_ns + (contact_->captured ? kAfterCaptureNs : kAfterBounceNs))
        return contact_->captured ? Ending::captured : Ending::bounced;
    if (t_ns() >= to_ns(scenario_.duration_s)) return Ending::duration;
    if (command_.phase == GuidancePhase::done) return Ending::navigation_done;
    if (command_.phase == GuidancePhase::retreating &&
        port().range_m() > kLeftDistances * norm(scenario_.start.position_m))
        return Ending::left;
    return Ending::not_yet;
}

}  // namespace narpa::rehearsal
