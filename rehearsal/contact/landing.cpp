#include "rehearsal/contact/landing.h"

#include <cmath>

#include "base/constants.h"

namespace narpa::rehearsal {

std::span<const LandingLimit> landing_limits() {
    using S = PortState;
    using G = Footing;
    using L = LandingLimits;
    static constexpr LandingLimit kLimits[] = {
        {"vertical_m_s", "vertical_velocity", "vertical velocity", "m/s", &L::vertical_m_s,
         [](const S& s, const G&) { return std::abs(s.closing_m_s()); }},
        {"horizontal_m_s", "horizontal_velocity", "horizontal velocity", "m/s", &L::horizontal_m_s,
         [](const S& s, const G&) { return s.lateral_m_s(); }},
        {"tilt_deg", "tilt", "tilt", "deg", &L::tilt_deg,
         [](const S& s, const G&) { return s.pitch_yaw_rad() * kDegPerRad; }},
        {"rate_deg_s", "rate", "angular rate", "deg/s", &L::rate_deg_s,
         [](const S& s, const G&) { return norm(s.rate_rad_s) * kDegPerRad; }},
        {"from_site_m", "site", "distance from the site", "m", &L::from_site_m,
         [](const S& s, const G&) { return s.lateral_m(); }},
        {"slope_deg", "slope", "slope under the feet", "deg", &L::slope_deg,
         [](const S&, const G& g) { return g.slope_rad * kDegPerRad; }, true},
        {"step_m", "step", "ground above the feet's plane", "m", &L::step_m,
         [](const S&, const G& g) { return g.step_m; }, true},
    };
    return kLimits;
}

ContactConditions landing_conditions(const LandingLimits& limits, const PortState& s,
                                     const std::optional<Footing>& ground) {
    ContactConditions all;
    for (const LandingLimit& l : landing_limits())
        if (ground || !l.of_ground)
            all.push_back({l.name, l.title, l.unit, l.value(s, ground.value_or(Footing{})), 0, limits.*l.max});
    return all;
}

std::vector<Vec3> feet_at_site(std::span<const Vec3> feet_m, const PortState& state) {
    std::vector<Vec3> feet;
    for (const Vec3& foot : feet_m) feet.push_back(state.T_port_chaser_port * foot);
    return feet;
}

}  // namespace narpa::rehearsal
