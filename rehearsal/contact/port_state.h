/// rehearsal/contact/port_state.h - the chaser's docking port relative to the target's: pose, velocity, rate, and
/// the scalars that have limits. Dynamics, navigation and judge all use these functions, so that equal inputs give
/// bit-identical results.
///
/// Port axes: x out of the docking interface. When docked, the chaser's port axes are the target's rotated by 180
/// degrees about z.
#pragma once

#include <vector>

#include "base/pose.h"

namespace narpa::rehearsal {

struct Vehicle;

/// Transforms the chaser's port axes to the target's when docked.
[[nodiscard]] inline Rigid3 T_port_docked() {
    return {{0, 0, 0, 1}, {}};
}

struct PortState {
    Rigid3 T_port_chaser_port{};  ///< chaser's port axes to target's port axes
    Vec3 velocity_m_s{};  ///< of the chaser's port origin, relative to the rotating axes of the target's port
    Vec3 rate_rad_s{};    ///< of the chaser relative to the target, chaser's port axes

    [[nodiscard]] const Vec3& position_m() const { return T_port_chaser_port.t; }
    [[nodiscard]] double range_m() const { return norm(position_m()); }
    [[nodiscard]] double lateral_m() const;    ///< distance from the port's x axis
    [[nodiscard]] double closing_m_s() const;  ///< along -x
    [[nodiscard]] double lateral_m_s() const;  ///< across x

    /// Rotation vector from the docked attitude, chaser's port axes.
    [[nodiscard]] Vec3 misalignment_rad() const;
    /// The misalignment as swing and twist: the angle between the ports' axes, then the angle about them; both in
    /// [0, pi].
    [[nodiscard]] double pitch_yaw_rad() const;
    [[nodiscard]] double roll_rad() const;
    [[nodiscard]] double pitch_yaw_rad_s() const;
    [[nodiscard]] double roll_rad_s() const;
};

/// The motion of axes fixed to a body; applied to a port with the inverse transform it gives the body's motion.
[[nodiscard]] Motion fixed_to(const Motion& body, const Rigid3& T_body_axes);

/// Both motions are of the port axes.
[[nodiscard]] PortState port_state(const Motion& target_port, const Motion& chaser_port);
/// Inverse of port_state(): the motion of the chaser's port axes.
[[nodiscard]] Motion chaser_port_motion(const PortState& state, const Motion& target_port);

/// The same from the motions of the bodies' axes, as in the scene and on CAN.
[[nodiscard]] PortState port_state(const Vehicle& target, const Motion& target_body, const Vehicle& chaser,
                                   const Motion& chaser_body);
[[nodiscard]] Motion chaser_motion(const PortState& state, const Vehicle& target, const Motion& target_body,
                                   const Vehicle& chaser);

/// Defaults: International Docking System Standard, Interface Definition Document, revision E, table of initial
/// contact conditions.
struct CaptureEnvelope {
    double closing_min_m_s = 0.05, closing_max_m_s = 0.10, lateral_rate_m_s = 0.04, lateral_m = 0.10;
    double pitch_yaw_deg = 4, roll_deg = 4, pitch_yaw_rate_deg_s = 0.20, roll_rate_deg_s = 0.20;
};

/// One quantity of a port state and its limits, which are inclusive.
struct ContactCondition {
    const char *name = "", *title = "", *unit = "";
    double value = 0, min = 0, max = 0;
    [[nodiscard]] bool within() const { return value >= min && value <= max; }
};

using ContactConditions = std::vector<ContactCondition>;
/// In the order of the standard's table.
[[nodiscard]] ContactConditions contact_conditions(const CaptureEnvelope& limits, const PortState& state);

/// True if all conditions hold.
[[nodiscard]] bool within(const CaptureEnvelope& limits, const PortState& state);

}  // namespace narpa::rehearsal
