#include "rehearsal/contact/landing.h"

#include <cmath>

#include "base/constants.h"

namespace narpa::rehearsal {

ContactConditions landing_conditions(const LandingLimits& limits, const PortState& s,
                                     const std::optional<Footing>& ground) {
    ContactConditions all{
        {"vertical_velocity", "vertical velocity", "m/s", std::abs(s.closing_m_s()), 0, limits.vertical_m_s},
        {"horizontal_velocity", "horizontal velocity", "m/s", s.lateral_m_s(), 0, limits.horizontal_m_s},
        {"tilt", "tilt", "deg", s.pitch_yaw_rad() * kDegPerRad, 0, limits.tilt_deg},
        {"rate", "angular rate", "deg/s", norm(s.rate_rad_s) * kDegPerRad, 0, limits.rate_deg_s},
        {"site", "distance from the site", "m", s.lateral_m(), 0, limits.from_site_m},
    };
    if (ground) {
        all.push_back(
            {"slope", "slope under the feet", "deg", ground->slope_rad * kDegPerRad, 0, limits.slope_deg});
        all.push_back({"step", "ground above the feet's plane", "m", ground->step_m, 0, limits.step_m});
    }
    return all;
}

std::vector<Vec3> feet_at_site(std::span<const Vec3> feet_m, const PortState& state) {
    std::vector<Vec3> feet;
    for (const Vec3& foot : feet_m) feet.push_back(state.T_port_chaser_port * foot);
    return feet;
}

}  // namespace narpa::rehearsal
