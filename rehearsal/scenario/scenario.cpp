#include "rehearsal/scenario/scenario.h"

#include <cmath>

namespace narpa::rehearsal {

double Orbit::rate_rad_s() const {
    if (model == Model::surface) return rotation_rad_s;
    return model == Model::free ? 0 : std::sqrt(mu_m3_s2 / (radius_m * radius_m * radius_m));
}

Quat Orbit::q_world_frame(double t_s) const {
    if (model == Model::surface) {
        const Vec3 z = normalized(axis);
        Vec3 x = up - dot(up, z) * z;  // direction of the ground site
        if (norm(x) < 1e-9) x = cross(z, std::abs(z.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0});  // at a pole: any
        x = normalized(x);
        return quat_from_columns(x, cross(z, x), z) * exp_rotation({0, 0, rotation_rad_s * t_s});
    }
    const Vec3 x = normalized(up);
    const Vec3 z = normalized(cross(x, along));
    return quat_from_columns(x, cross(z, x), z) * exp_rotation({0, 0, rate_rad_s() * t_s});
}

Vec3 Orbit::gravity_m_s2(const Vec3& from_centre_m, const Vec3& unit_axis) const {
    const double r = norm(from_centre_m), sine = dot(from_centre_m, unit_axis) / r;
    const double j = 1.5 * j2 * (equatorial_radius_m / r) * (equatorial_radius_m / r);
    const Vec3 out = from_centre_m / r;
    return (-mu_m3_s2 / (r * r)) * ((1 + j * (1 - 5 * sine * sine)) * out + (2 * j * sine) * unit_axis);
}

Vec3 Orbit::relative_free_fall_m_s2(double t_s, const Vec3& position_m) const {
    const Quat turned = q_world_frame(t_s) * conjugate(q_world_frame(0));
    const Vec3 z = normalized(axis), ground = radius_m * (turned * normalized(up)), rate = rotation_rad_s * z;
    return gravity_m_s2(ground + position_m, z) - cross(rate, cross(rate, ground));
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
