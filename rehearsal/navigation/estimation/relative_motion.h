/// rehearsal/navigation/estimation/relative_motion.h - the relative state in the three forms that navigation uses:
/// the filter's (LVLH), inertial axes, and port to port.
#pragma once

#include "estimator/filter/motion_model.h"
#include "rehearsal/contact/port_state.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// The chaser relative to the target's centre of mass, taken as at rest; world axes.
struct RelativeMotion {
    Vec3 position_m{}, velocity_m_s{};  ///< of the chaser's centre of mass, inertial
    Quat q_world_target{}, q_world_chaser{};
    Vec3 target_rate_rad_s{}, chaser_rate_rad_s{};  ///< against inertial space, each in its own body axes
};

/// The port's pose about the centre of mass, in body axes.
[[nodiscard]] Rigid3 port_from_mass(const Vehicle& vehicle);

/// The filter's state (motion_model.h; frame LVLH, inertial where the model is free) in inertial axes at t_s.
[[nodiscard]] RelativeMotion in_world(const RelativeState& state, const Orbit& orbit, double t_s,
                                      const Quat& q_world_chaser, const Vec3& chaser_rate_rad_s);
/// Inverse of in_world().
[[nodiscard]] RelativeState in_frame(const RelativeMotion& motion, const Orbit& orbit, double t_s);

[[nodiscard]] PortState port_state(const RelativeMotion& motion, const Vehicle& target, const Vehicle& chaser);
/// Sets position and velocity of the chaser's centre of mass so that its port's origin has these, in the target's
/// port axes; attitudes and rates stay.
void place_port(const Vec3& port_m, const Vec3& port_velocity_m_s, const Vehicle& target, const Vehicle& chaser,
                RelativeMotion& motion);

/// The target's rate at time 0, against inertial space, body axes.
[[nodiscard]] Vec3 nominal_target_rate_rad_s(const Scenario& scenario);

/// Surface model: gravity field for the filter's chaser, that of the point mass linearised about the target.
[[nodiscard]] GroundField ground_field(const Orbit& orbit);

/// Acceleration of the chaser by gravity minus that of the target, inertial axes: linearised about the target's
/// circular orbit; exact over ground.
[[nodiscard]] Vec3 gravity_difference_m_s2(const Orbit& orbit, double t_s, const Vec3& position_m);

}  // namespace narpa::rehearsal
