#include "rehearsal/navigation/guidance/guidance.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "estimator/pose/pose_estimate.h"

namespace narpa::rehearsal {

LegPath LegPath::along(const Leg& leg, const Vec3& from_m, double acceleration_m_s2) {
    LegPath p;
    p.from_m_ = from_m;
    p.acceleration_m_s2_ = acceleration_m_s2;
    if (leg.arc_deg) {
        p.axis_ = (*leg.arc_deg < 0 ? -1.0 : 1.0) * normalized(leg.axis);
        p.radius_m_ = norm(cross(p.axis_, from_m));
        p.length_m_ = p.radius_m_ * std::abs(*leg.arc_deg) * kDegree;
    } else {
        const Vec3 way = leg.to_m - from_m;
        p.length_m_ = norm(way);
        if (p.length_m_ > 0) p.direction_ = way / p.length_m_;
    }
    if (leg.contact) return away(from_m, p.direction_, 0, leg.speed_m_s, acceleration_m_s2);
    p.speed_m_s_ = std::min(leg.speed_m_s, std::sqrt(p.length_m_ * acceleration_m_s2));
    if (p.length_m_ > 0) p.duration_s_ = p.length_m_ / p.speed_m_s_ + p.speed_m_s_ / acceleration_m_s2;
    return p;
}

LegPath LegPath::away(const Vec3& from_m, const Vec3& direction, double first_m_s, double speed_m_s,
                      double acceleration_m_s2) {
    LegPath p;
    p.from_m_ = from_m;
    p.direction_ = direction;
    p.length_m_ = p.duration_s_ = std::numeric_limits<double>::infinity();
    p.first_m_s_ = first_m_s;
    p.speed_m_s_ = speed_m_s;
    p.acceleration_m_s2_ = std::copysign(acceleration_m_s2, speed_m_s - first_m_s);
    return p;
}

LegPath::Progress LegPath::progress(double t_s) const {
    const double a = acceleration_m_s2_;
    if (t_s <= 0) return {0, first_m_s_};
    if (t_s >= duration_s_) return {length_m_, 0};
    const double faster_s = (speed_m_s_ - first_m_s_) / a;
    if (t_s < faster_s) return {(first_m_s_ + 0.5 * a * t_s) * t_s, first_m_s_ + a * t_s};
    const double left_s = duration_s_ - t_s;
    if (left_s < speed_m_s_ / a) return {length_m_ - 0.5 * a * left_s * left_s, a * left_s};
    return {0.5 * (first_m_s_ + speed_m_s_) * faster_s + speed_m_s_ * (t_s - faster_s), speed_m_s_};
}

Vec3 LegPath::at(double way_m) const {
    if (radius_m_ > 0) return exp_rotation((way_m / radius_m_) * axis_) * from_m_;
    return from_m_ + way_m * direction_;
}

Vec3 LegPath::position_m(double t_s) const {
    return at(progress(t_s).way_m);
}

Vec3 LegPath::velocity_m_s(double t_s) const {
    const Progress p = progress(t_s);
    if (radius_m_ > 0) return (p.speed_m_s / radius_m_) * cross(axis_, at(p.way_m));
    return p.speed_m_s * direction_;
}

DescentPath::DescentPath(const Vec3& from_m, const Vec3& from_m_s, const Vec3& to_m, const Vec3& to_m_s,
                         double to_go_s)
    : to_m_(to_m), to_m_s_(to_m_s) {
    assert(to_go_s > 0);
    const double t = -to_go_s;
    const Vec3 position = from_m - to_m - t * to_m_s, velocity = from_m_s - to_m_s;
    // position = jerk t^3 / 6 + snap t^4 / 24, velocity = jerk t^2 / 2 + snap t^3 / 6
    snap_ = (24 * velocity * t - 72 * position) / (t * t * t * t);
    jerk_ = (24 * position - 6 * velocity * t) / (t * t * t);
}

Vec3 DescentPath::position_m(double t_s) const {
    const double t = std::min(t_s, 0.0);
    return to_m_ + t_s * to_m_s_ + (t * t * t / 6) * jerk_ + (t * t * t * t / 24) * snap_;
}

Vec3 DescentPath::velocity_m_s(double t_s) const {
    const double t = std::min(t_s, 0.0);
    return to_m_s_ + (0.5 * t * t) * jerk_ + (t * t * t / 6) * snap_;
}

Vec3 DescentPath::acceleration_m_s2(double t_s) const {
    const double t = std::min(t_s, 0.0);
    return t * jerk_ + (0.5 * t * t) * snap_;
}

namespace {

/// A descent is replanned from each estimate until this long before its end; then the last plan is followed.
constexpr double kPlanned_s = 12;

/// Shares of the thrusters' acceleration that the reference uses; the rest is left to the controller. A retreat has
/// a larger share, as it must stop before the port.
constexpr double kShareOfThrust = 0.2, kShareToRetreat = 0.6;
/// Half step of the central difference for the reference's angular rate.
constexpr double kRateStep_s = 0.05;

/// x towards the origin, z as close to the port's z as possible.
Quat looking_at_origin(const Vec3& position_m) {
    if (norm(position_m) < 1e-6) return T_port_docked().q;
    const Vec3 x = -normalized(position_m);
    Vec3 y = cross(Vec3{0, 0, 1}, x);
    if (norm(y) < 1e-6) y = {0, -1, 0};  // along z: the docked attitude
    y = normalized(y);
    return quat_from_columns(x, y, cross(x, y));
}

/// Duration of a path that starts at rest and accelerates up to `speed_m_s`.
double from_rest_s(double way_m, double speed_m_s, double acceleration_m_s2) {
    const double faster_m = 0.5 * speed_m_s * speed_m_s / acceleration_m_s2;
    if (way_m < faster_m) return std::sqrt(2 * way_m / acceleration_m_s2);
    return way_m / speed_m_s + 0.5 * speed_m_s / acceleration_m_s2;
}

}  // namespace

double Scenario::legs_duration_s() const {
    double t_s = 0;
    Vec3 at = start.position_m;
    for (const Leg& leg : legs) {
        if (leg.descent_s) {
            t_s += *leg.descent_s;
            at = leg.to_m;
            continue;
        }
        const double acceleration_m_s2 = kShareOfThrust * thrust_n() / chaser.mass_kg;
        const LegPath path = LegPath::along(leg, at, acceleration_m_s2);
        t_s += leg.contact ? from_rest_s(norm(leg.to_m - at), leg.speed_m_s, acceleration_m_s2)
                           : path.duration_s() + leg.hold_s;
        if (!leg.contact) at = path.end_m();
    }
    return t_s;
}

Guidance::Guidance(const Scenario& scenario, double t_s)
    : legs_(scenario.legs),
      limits_(scenario.navigation),
      control_(scenario.control),
      period_s_(scenario.navigation.period_s),
      thrust_m_s2_(scenario.thrust_n() / scenario.chaser.mass_kg) {
    begin_leg(scenario.start.position_m, t_s);
}

void Guidance::begin_leg(const Vec3& from_m, double t_s) {
    assert(leg_ < legs_.size());
    const Leg& leg = legs_[leg_];
    path_ = LegPath::along(leg, from_m, kShareOfThrust * thrust_m_s2_);
    if (leg.contact && leg_ > 0 && legs_[leg_ - 1].descent_s) {
        const Vec3 way = leg.to_m - from_m;
        const Vec3 direction = way / norm(way);
        path_ = LegPath::away(from_m, direction, dot(legs_[leg_ - 1].end_velocity_m_s, direction), leg.speed_m_s,
                              kShareOfThrust * thrust_m_s2_);
    }
    leg_from_s_ = t_s;
    phase_ = phase_of(leg_);
}

GuidancePhase Guidance::phase_of(std::size_t leg) const {
    const bool descent_before = leg > 0 && legs_[leg - 1].descent_s.has_value();
    if (legs_[leg].descent_s) return descent_before ? GuidancePhase::approach : GuidancePhase::braking;
    if (legs_[leg].contact) return descent_before ? GuidancePhase::terminal_descent : GuidancePhase::closing;
    return GuidancePhase::moving;
}

void Guidance::step(const GuidanceInput& input) {
    if (thrusters_off() || phase_ == GuidancePhase::retreating) return;
    if (input.dynamics == DynamicsPhase::touched_down || input.dynamics == DynamicsPhase::landed ||
        input.dynamics == DynamicsPhase::crashed) {
        phase_ = GuidancePhase::landed;
        path_ = LegPath::along({}, {}, kShareOfThrust * thrust_m_s2_);
    } else if (input.dynamics == DynamicsPhase::captured) {
        phase_ = GuidancePhase::docked;
        path_ = LegPath::along({}, {}, kShareOfThrust * thrust_m_s2_);  // at rest, port to port
    } else if (input.dynamics == DynamicsPhase::bounced) {
        retreat(input, AbortReason::bounced);
    } else if (const AbortReason reason = reason_to_abort(input); reason != AbortReason::none) {
        retreat(input, reason);
    } else {
        fly(input);
    }
}

AbortReason Guidance::reason_to_abort(const GuidanceInput& input) const {
    if (input.unmeasured_s > limits_.abort_lost_s) return AbortReason::lost;
    if (!(input.position_sigma_m <= limits_.abort_sigma_m)) return AbortReason::uncertain;
    if (descends()) return AbortReason::none;  // the plan starts at the estimate
    if (!(norm(input.port_m - path_.position_m(input.t_s - leg_from_s_)) <= limits_.abort_off_m))
        return AbortReason::off_reference;
    return AbortReason::none;
}

/// After contact and within the 45 degree cone before the port: along the port's axis; otherwise radially away.
/// After contact the retreat starts at rest.
void Guidance::retreat(const GuidanceInput& input, AbortReason reason) {
    const Vec3& r = input.port_m;
    const bool bounced = reason == AbortReason::bounced;
    const bool before_port = r.x >= std::hypot(r.y, r.z);
    const Vec3 direction = bounced || before_port ? Vec3{1, 0, 0} : normalized(r);
    const double first_m_s = bounced ? 0 : dot(input.port_velocity_m_s, direction);
    path_ = LegPath::away(r, direction, first_m_s, control_.retreat_m_s, kShareToRetreat * thrust_m_s2_);
    leg_from_s_ = input.t_s;
    phase_ = GuidancePhase::retreating;
    abort_ = reason;
}

/// Plans from the estimate, while its noise divided by the time to go is small.
void Guidance::plan_descent(const GuidanceInput& input) {
    const Leg& leg = legs_[leg_];
    const double left_s = to_go_s(input.t_s);
    if (left_s >= std::min(kPlanned_s, *leg.descent_s))
        descent_ = DescentPath(input.port_m, input.port_velocity_m_s, leg.to_m, leg.end_velocity_m_s, left_s);
}

void Guidance::fly(const GuidanceInput& input) {
    if (descends()) {
        plan_descent(input);
        if (to_go_s(input.t_s) > 0) return;
        if (leg_ + 1 == legs_.size()) {
            phase_ = GuidancePhase::done;
        } else {
            ++leg_;
            begin_leg(legs_[leg_ - 1].to_m, input.t_s);
        }
        return;
    }
    const double flown_s = input.t_s - leg_from_s_;
    if (phase_ == GuidancePhase::done || flown_s < path_.duration_s()) return;
    const Leg& leg = legs_[leg_];
    phase_ = GuidancePhase::holding;
    const bool there = norm(input.port_m - path_.end_m()) <= leg.within_m;
    if (flown_s < path_.duration_s() + leg.hold_s || !there) return;
    if (leg_ + 1 < legs_.size()) {
        ++leg_;
        begin_leg(path_.end_m(), input.t_s);
    } else {
        phase_ = GuidancePhase::done;
    }
}

Guidance::Pose Guidance::pose(double t_s) const {
    const double t = t_s - leg_from_s_;
    if (descends()) {
        const double left_s = to_go_s(t_s);
        return {descent_.position_m(-left_s), descent_.velocity_m_s(-left_s), T_port_docked().q};
    }
    Pose p{path_.position_m(t), path_.velocity_m_s(t), T_port_docked().q};
    if (legs_[leg_].look_at_target) p.q = looking_at_origin(p.position_m);
    return p;
}

Vec3 Guidance::rate(double t_s) const {
    if (!legs_[leg_].look_at_target) return {};
    const Quat turn = pose(t_s + kRateStep_s).q * conjugate(pose(t_s - kRateStep_s).q);
    return rotation_vector(turn) / (2 * kRateStep_s);
}

Reference Guidance::reference(double t_s) const {
    const Pose now = pose(t_s), then = pose(t_s + period_s_);
    Reference r;
    r.position_m = now.position_m;
    r.velocity_m_s = now.velocity_m_s;
    r.q_port_chaser_port = now.q;
    r.rate_rad_s = rate(t_s);
    r.acceleration_m_s2 = (then.velocity_m_s - now.velocity_m_s) / period_s_;
    r.angular_acceleration_rad_s2 = (rate(t_s + period_s_) - r.rate_rad_s) / period_s_;
    return r;
}

}  // namespace narpa::rehearsal
