/// rehearsal/contact/landing.h - limits of a landing, and the values that they apply to.
#pragma once

#include <span>
#include <string_view>

#include "rehearsal/contact/port_state.h"
#include "rehearsal/contact/terrain.h"

namespace narpa::rehearsal {

/// Motion limits of the chaser's port (the middle of its feet) when the first foot touches the ground; slope and
/// step are those of the ground that it stands on.
struct LandingLimits {
    double vertical_m_s = 1.5, horizontal_m_s = 0.5;
    double tilt_deg = 5, rate_deg_s = 3;
    double from_site_m = 10;
    double slope_deg = 10, step_m = 0.3;
};

/// One of them; each is a gate of its own.
struct LandingLimit {
    std::string_view key;  ///< in scenario files
    const char *name, *title, *unit;
    double LandingLimits::*max;
    double (*value)(const PortState& touchdown, const Footing& ground);
    bool of_ground = false;  ///< of the ground that it stands on
};
[[nodiscard]] std::span<const LandingLimit> landing_limits();

/// `touchdown`: state when the first foot touches the ground. `ground`: under the feet; none: slope and step are
/// left out.
[[nodiscard]] ContactConditions landing_conditions(const LandingLimits& limits, const PortState& touchdown,
                                                   const std::optional<Footing>& ground);

/// Positions of the feet, in the site's axes.
[[nodiscard]] std::vector<Vec3> feet_at_site(std::span<const Vec3> feet_m, const PortState& state);

}  // namespace narpa::rehearsal
