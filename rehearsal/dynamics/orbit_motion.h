/// rehearsal/dynamics/orbit_motion.h - how the chaser's centre of mass moves beside the target's, which flies on a
/// circular orbit.
#pragma once

#include "base/pose.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Of the chaser's centre of mass from the target's, world axes (inertial).
struct Translation {
    Vec3 position_m{}, velocity_m_s{};
};

/// dt_s later. `acceleration_m_s2`: what the thrusters do, world axes, constant; of Clohessy and Wiltshire's
/// equations constant in LVLH, as it is in the middle of the time. Free and Clohessy-Wiltshire: exact, in closed
/// form. Two bodies: the target's circle is exact, the difference of gravity is in the form of R. Battin ("An
/// Introduction to the Mathematics and Methods of Astrodynamics", 1999, section 8.5), which loses no digits to the
/// orbit's radius, and is integrated by Runge and Kutta in steps of a second at most: 1e-12 of the distance in an
/// orbit at 400 km.
[[nodiscard]] Translation coasted(const Orbit& orbit, double t_s, double dt_s, const Vec3& acceleration_m_s2,
                                  const Translation& from);

/// The attractor beside the target, world axes; it does not turn.
[[nodiscard]] Motion attractor_motion(const Orbit& orbit, const Quat& q_world_attractor, double t_s);

}  // namespace narpa::rehearsal
