/// rehearsal/dynamics/port_motion.h - the chaser's docking port as the target's sees it.
#pragma once

#include <utility>

#include "base/pose.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Target's port axes, unless said otherwise.
struct PortMotion {
    Vec3 position_m{};    ///< of the chaser's port origin
    Vec3 velocity_m_s{};  ///< as the turning port axes see it
    Vec3 attitude_rad{};  ///< rotation vector off the docked attitude, chaser's port axes
    Vec3 rate_rad_s{};    ///< of the chaser against the target, chaser's port axes
};

/// Both motions are of the bodies' origins, as in the scene.
[[nodiscard]] PortMotion port_motion(const Vehicle& target, const Motion& target_motion, const Vehicle& chaser,
                                     const Motion& chaser_motion);

/// The chaser's motion that has its port so.
[[nodiscard]] Motion chaser_motion(const PortMotion& port, const Vehicle& target, const Motion& target_motion,
                                   const Vehicle& chaser);

/// Within what the docking system takes: each condition of Gates::Contact.
[[nodiscard]] bool within(const Gates::Contact& envelope, const PortMotion& port);

}  // namespace narpa::rehearsal
