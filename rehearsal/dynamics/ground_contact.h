/// rehearsal/dynamics/ground_contact.h - forces between the feet of a lander and the ground.
///
/// Each foot is a spring and a damper along the ground's normal, which push and never pull, and a spring and a
/// damper across it that hold the foot at its contact point until friction slips (P. Cundall, O. Strack,
/// Geotechnique 29, 1979).
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "rehearsal/contact/port_state.h"
#include "rehearsal/contact/terrain.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Force and torque on the chaser, site axes (the target's port); the torque is about the port's origin.
struct GroundForces {
    Vec3 force_n{}, torque_n_m{};
    double deepest_m = 0;  ///< largest penetration of a foot into the ground
};

class GroundContact {
public:
    GroundContact(const LandingGear& gear, std::shared_ptr<const Terrain> terrain)
        : gear_(gear), terrain_(std::move(terrain)), held_(gear.feet_m.size()) {}

    /// Height of the lowest foot above the ground; infinite where there is no ground.
    [[nodiscard]] double clearance_m(const PortState& lander) const;
    /// Updates the anchor points of the feet.
    GroundForces press(const PortState& lander);

private:
    LandingGear gear_;
    std::shared_ptr<const Terrain> terrain_;
    std::vector<std::optional<Vec3>> held_;  ///< anchor point of each foot that touches the ground
};

}  // namespace narpa::rehearsal
