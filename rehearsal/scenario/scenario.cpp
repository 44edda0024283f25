#include "rehearsal/scenario/scenario.h"

#include <cmath>

namespace narpa::rehearsal {

ModelUncertainty ModelError::uncertainty() const {
    ModelUncertainty u = error;
    for (const ModelErrorName& name : kModelErrors) u.*name.field *= told;
    return u;
}

std::int64_t Scenario::period_ns() const {
    return std::llround(navigation.period_s * 1e9);
}

std::int64_t Scenario::pose_period_ns() const {
    return std::llround(1e9 / pose_rate_hz);
}

}  // namespace narpa::rehearsal
