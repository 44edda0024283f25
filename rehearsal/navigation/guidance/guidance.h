/// rehearsal/navigation/guidance/guidance.h - the reference trajectory of the chaser's port: along the scenario's
/// legs, to contact, in powered descent, or in retreat.
#pragma once

#include <vector>

#include "protocols/closed_loop.h"
#include "rehearsal/navigation/estimation/relative_motion.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// A straight line or an arc about the origin, with a trapezoidal speed profile (triangular if it is short). Times
/// count from its start; before and after, the position is that of the nearer end.
class LegPath {
public:
    /// A leg to contact has no end.
    static LegPath along(const Leg& leg, const Vec3& from_m, double acceleration_m_s2);
    /// A straight path without end; the speed changes uniformly from `first_m_s`, which may be negative, to
    /// `speed_m_s`.
    static LegPath away(const Vec3& from_m, const Vec3& direction, double first_m_s, double speed_m_s,
                        double acceleration_m_s2);

    /// Infinite for a path without end.
    [[nodiscard]] double duration_s() const noexcept { return duration_s_; }
    [[nodiscard]] Vec3 position_m(double t_s) const;
    [[nodiscard]] Vec3 velocity_m_s(double t_s) const;
    [[nodiscard]] Vec3 end_m() const { return at(length_m_); }

private:
    /// Distance along the path, and speed.
    struct Progress {
        double way_m, speed_m_s;
    };
    [[nodiscard]] Progress progress(double t_s) const;
    [[nodiscard]] Vec3 at(double way_m) const;

    Vec3 from_m_{}, direction_{-1, 0, 0};  ///< direction: unit, of a straight path
    Vec3 axis_{};                          ///< of an arc: unit, right-handed
    double radius_m_ = 0;                  ///< > 0: an arc
    double length_m_ = 0, duration_s_ = 0;
    double first_m_s_ = 0, speed_m_s_ = 0, acceleration_m_s2_ = 1;
};

/// Powered descent: the fourth-order polynomial from a position and velocity to a position, a velocity and zero
/// acceleration after a given time (the quadratic guidance of A. Klumpp, "Apollo lunar descent guidance",
/// Automatica 10, 1974).
class DescentPath {
public:
    DescentPath() = default;
    /// `to_go_s` > 0. Times count from the end, and are negative before.
    DescentPath(const Vec3& from_m, const Vec3& from_m_s, const Vec3& to_m, const Vec3& to_m_s, double to_go_s);

    /// After the end: constant velocity.
    [[nodiscard]] Vec3 position_m(double t_s) const;
    [[nodiscard]] Vec3 velocity_m_s(double t_s) const;
    [[nodiscard]] Vec3 acceleration_m_s2(double t_s) const;

private:
    Vec3 to_m_{}, to_m_s_{}, jerk_{}, snap_{};  ///< at the end
};

/// Reference state of the chaser's port, in the (rotating) axes of the target's port.
struct Reference {
    Vec3 position_m{}, velocity_m_s{};
    Quat q_port_chaser_port{};
    Vec3 rate_rad_s{};  ///< of the chaser's port axes against the target's
    /// Means over the following control period.
    Vec3 acceleration_m_s2{}, angular_acceleration_rad_s2{};
};

struct GuidanceInput {
    double t_s = 0;
    Vec3 port_m{}, port_velocity_m_s{};  ///< estimate of the chaser's port origin, target's port axes
    double position_sigma_m = 0;         ///< root of the summed variances
    double unmeasured_s = 0;             ///< since the last accepted measurement
    DynamicsPhase dynamics = DynamicsPhase::flying;
};

class Guidance {
public:
    /// Legs begin at t_s from the nominal start.
    Guidance(const Scenario& scenario, double t_s);

    /// Call once each control period: switches legs, replans a descent, aborts, ends at capture or touchdown. A
    /// contact without capture starts a retreat.
    void step(const GuidanceInput& input);

    [[nodiscard]] GuidancePhase phase() const noexcept { return phase_; }
    [[nodiscard]] std::size_t leg() const noexcept { return leg_; }
    [[nodiscard]] AbortReason abort() const noexcept { return abort_; }
    /// True after capture or touchdown.
    [[nodiscard]] bool thrusters_off() const noexcept {
        return phase_ == GuidancePhase::docked || phase_ == GuidancePhase::landed;
    }
    /// At any time of the current leg.
    [[nodiscard]] Reference reference(double t_s) const;

private:
    struct Pose {
        Vec3 position_m, velocity_m_s;
        Quat q;
    };
    [[nodiscard]] Pose pose(double t_s) const;
    [[nodiscard]] Vec3 rate(double t_s) const;
    [[nodiscard]] AbortReason reason_to_abort(const GuidanceInput& input) const;
    void retreat(const GuidanceInput& input, AbortReason reason);
    void begin_leg(const Vec3& from_m, double t_s);
    [[nodiscard]] GuidancePhase phase_of(std::size_t leg) const;
    void fly(const GuidanceInput& input);
    void plan_descent(const GuidanceInput& input);
    [[nodiscard]] double to_go_s(double t_s) const { return leg_from_s_ + *legs_[leg_].descent_s - t_s; }
    [[nodiscard]] bool descends() const {
        return phase_ == GuidancePhase::braking || phase_ == GuidancePhase::approach;
    }

    std::vector<Leg> legs_;
    Navigation limits_;
    Control control_;
    double period_s_, thrust_m_s2_;
    std::size_t leg_ = 0;
    LegPath path_;
    DescentPath descent_;
    double leg_from_s_ = 0;
    GuidancePhase phase_ = GuidancePhase::moving;
    AbortReason abort_ = AbortReason::none;
};

}  // namespace narpa::rehearsal
