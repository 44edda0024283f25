#include "rehearsal/docking/capture_envelope.h"

#include <algorithm>
#include "base/constants.h"

namespace narpa::rehearsal {

ContactConditions contact_conditions(const CaptureEnvelope& limits, const PortState& s) {
    return {{
        {"closing_rate", "closing rate", "m/s", s.closing_m_s(), limits.closing_min_m_s, limits.closing_max_m_s},
        {"lateral_rate", "lateral rate", "m/s", s.lateral_m_s(), 0, limits.lateral_rate_m_s},
        {"lateral", "lateral misalignment", "m", s.lateral_m(), 0, limits.lateral_m},
        {"pitch_yaw", "pitch and yaw", "deg", s.pitch_yaw_rad() * kDegPerRad, 0, limits.pitch_yaw_deg},
        {"roll", "roll", "deg", s.roll_rad() * kDegPerRad, 0, limits.roll_deg},
        {"pitch_yaw_rate", "pitch and yaw rate", "deg/s", s.pitch_yaw_rad_s() * kDegPerRad, 0,
         limits.pitch_yaw_rate_deg_s},
        {"roll_rate", "roll rate", "deg/s", s.roll_rad_s() * kDegPerRad, 0, limits.roll_rate_deg_s},
    }};
}

bool within(const CaptureEnvelope& limits, const PortState& state) {
    const ContactConditions conditions = contact_conditions(limits, state);
    return std::all_of(conditions.begin(), conditions.end(), [](const ContactCondition& c) { return c.within(); });
}

}  // namespace narpa::rehearsal
