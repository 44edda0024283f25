#include "rehearsal/scenario/scenario.h"

#include <cmath>

namespace narpa::rehearsal {

double Orbit::rate_rad_s() const {
    return model == Model::free ? 0 : std::sqrt(mu_m3_s2 / (radius_m * radius_m * radius_m));
}

Quat Orbit::q_world_lvlh(double t_s) const {
    const Vec3 x = normalized(up);
    const Vec3 z = normalized(cross(x, along));
    return quat_from_columns(x, cross(z, x), z) * exp_rotation({0, 0, rate_rad_s() * t_s});
}

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
