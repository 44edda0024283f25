/// rehearsal/docking/capture_envelope.h - the port states in which a docking system captures. The dynamics decide
/// by it whether the ports hold or bounce, the judge whether the contact gate passes.
#pragma once

#include <array>

#include "rehearsal/docking/port_state.h"

namespace narpa::rehearsal {

/// Defaults: International Docking System Standard, Interface Definition Document, revision E, table of initial
/// contact conditions.
struct CaptureEnvelope {
    double closing_min_m_s = 0.05, closing_max_m_s = 0.10, lateral_rate_m_s = 0.04, lateral_m = 0.10;
    double pitch_yaw_deg = 4, roll_deg = 4, pitch_yaw_rate_deg_s = 0.20, roll_rate_deg_s = 0.20;
};

/// One quantity of a port state and its limits, which belong to the allowed range.
struct ContactCondition {
    const char *name = "", *title = "", *unit = "";
    double value = 0, min = 0, max = 0;
    [[nodiscard]] bool within() const { return value >= min && value <= max; }
};

/// In the order of the standard's table.
using ContactConditions = std::array<ContactCondition, 7>;
[[nodiscard]] ContactConditions contact_conditions(const CaptureEnvelope& limits, const PortState& state);

/// All of them.
[[nodiscard]] bool within(const CaptureEnvelope& limits, const PortState& state);

}  // namespace narpa::rehearsal
