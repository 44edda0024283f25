#include "rehearsal/orbit/orbit.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/filter/motion_model.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa::rehearsal {
namespace {

constexpr double kLongestStepS = 1;

/// Motion from rest at the origin under the constant acceleration a, LVLH axes.
Translation clohessy_wiltshire_push(double n, double t, const Vec3& a) {
    const double nt = n * t, s = std::sin(nt), half = std::sin(0.5 * nt);
    const double versine = 2 * half * half;  // 1 - cos
    const double lag = nt - s;
    return {{(a.x * versine + 2 * a.y * lag) / (n * n),
             (-2 * a.x * lag + 4 * a.y * versine) / (n * n) - 1.5 * a.y * t * t, a.z * versine / (n * n)},
            {(a.x * s + 2 * a.y * versine) / n, (-2 * a.x * versine + 4 * a.y * s) / n - 3 * a.y * t, a.z * s / n}};
}

Translation clohessy_wiltshire(const Orbit& orbit, double t, double dt, const Vec3& a, const Translation& x) {
    const double n = orbit.rate_rad_s();
    const Vec3 rate{0, 0, n};
    const Quat q_lvlh_world = conjugate(orbit.q_world_frame(t));
    const Vec3 position = q_lvlh_world * x.position_m;
    const Vec3 velocity = q_lvlh_world * x.velocity_m_s - cross(rate, position);
    Vector6 state;
    state << to_eigen(position), to_eigen(velocity);
    state = (clohessy_wiltshire_transition(n, dt) * state).eval();
    const Translation pushed = clohessy_wiltshire_push(n, dt, conjugate(orbit.q_world_frame(t + 0.5 * dt)) * a);
    const Vec3 position_then = Vec3{state[0], state[1], state[2]} + pushed.position_m;
    const Vec3 velocity_then = Vec3{state[3], state[4], state[5]} + pushed.velocity_m_s;
    const Quat q_world_frame = orbit.q_world_frame(t + dt);
    return {q_world_frame * position_then, q_world_frame * (velocity_then + cross(rate, position_then))};
}

/// Gravity at the chaser minus gravity at the target, which is at R from the attractor.
Vec3 gravity_difference(double mu, const Vec3& R, const Vec3& r) {
    const double square = dot(R, R);
    const double q = dot(r, r + 2.0 * R) / square;
    const double root = std::sqrt(1 + q) * (1 + q);
    const double f = -q * (3 + q * (3 + q)) / (root * (1 + root));  // (1 + q)^-3/2 - 1
    return (-mu / (square * std::sqrt(square))) * (r + f * (R + r));
}

/// `rates(after_s, state)`: derivatives at after_s from the start of the step h.
template <class Rates>
Translation runge_kutta(double h, const Translation& x, const Rates& rates) {
    const auto moved = [&](const Translation& rate, double by) {
        return Translation{x.position_m + by * rate.position_m, x.velocity_m_s + by * rate.velocity_m_s};
    };
    const Translation k1 = rates(0, x), k2 = rates(0.5 * h, moved(k1, 0.5 * h));
    const Translation k3 = rates(0.5 * h, moved(k2, 0.5 * h)), k4 = rates(h, moved(k3, h));
    return {x.position_m + h / 6 * (k1.position_m + 2.0 * k2.position_m + 2.0 * k3.position_m + k4.position_m),
            x.velocity_m_s +
                h / 6 * (k1.velocity_m_s + 2.0 * k2.velocity_m_s + 2.0 * k3.velocity_m_s + k4.velocity_m_s)};
}

Translation two_body_step(const Orbit& orbit, double t, double h, const Vec3& a, const Translation& x) {
    return runge_kutta(h, x, [&](double after_s, const Translation& s) {
        const Vec3 R = orbit.q_world_frame(t + after_s) * Vec3{orbit.radius_m, 0, 0};
        return Translation{s.velocity_m_s, gravity_difference(orbit.mu_m3_s2, R, s.position_m) + a};
    });
}

/// One step over the ground of a rotating planet.
Translation surface_step(const Orbit& orbit, double t, double h, const Vec3& a, const Translation& x) {
    return runge_kutta(h, x, [&](double after_s, const Translation& s) {
        return Translation{s.velocity_m_s, orbit.relative_free_fall_m_s2(t + after_s, s.position_m) + a};
    });
}

template <class Step>
Translation in_steps(const Step& step, const Orbit& orbit, double t, double dt, const Vec3& a, Translation x) {
    const int steps = std::max(1, static_cast<int>(std::ceil(std::abs(dt) / kLongestStepS)));
    const double h = dt / steps;
    for (int i = 0; i < steps; ++i) x = step(orbit, t + i * h, h, a, x);
    return x;
}

/// Of a circular orbit.
double circular_rate_rad_s(const Orbit& orbit) {
    return std::sqrt(orbit.mu_m3_s2 / (orbit.radius_m * orbit.radius_m * orbit.radius_m));
}

constexpr std::array<OrbitModel, 4> kModels{{
    {"free", "no attractor: the world is inertial, and so is \"LVLH\"", false, false,
     [](const Orbit&) { return 0.0; },
     [](const Orbit&, double, double dt, const Vec3& a, const Translation& x) {
         return Translation{x.position_m + dt * x.velocity_m_s + (0.5 * dt * dt) * a, x.velocity_m_s + dt * a};
     }},
    {"clohessy-wiltshire", "linear, about a circular orbit", true, false, circular_rate_rad_s, clohessy_wiltshire},
    {"two-body", "both bodies about a point mass", true, false, circular_rate_rad_s,
     [](const Orbit& o, double t, double dt, const Vec3& a, const Translation& x) {
         return in_steps(two_body_step, o, t, dt, a, x);
     }},
    {"surface", "the target is ground of a rotating planet", false, true,
     [](const Orbit& o) { return o.rotation_rad_s; },
     [](const Orbit& o, double t, double dt, const Vec3& a, const Translation& x) {
         return in_steps(surface_step, o, t, dt, a, x);
     }},
}};

}  // namespace

std::span<const OrbitModel> orbit_models() {
    return kModels;
}

const OrbitModel* orbit_model(std::string_view name) {
    const auto model = std::ranges::find(kModels, name, &OrbitModel::name);
    return model == kModels.end() ? nullptr : &*model;
}

Quat Orbit::q_world_frame(double t_s) const {
    Vec3 x = normalized(up), z = normalized(axis);
    if (model->over_ground) {
        x = up - dot(up, z) * z;  // direction of the ground site
        if (norm(x) < 1e-9) x = cross(z, std::abs(z.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0});  // at a pole: any
        x = normalized(x);
    } else {
        z = normalized(cross(x, along));
    }
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

Translation propagated(const Orbit& orbit, double t_s, double dt_s, const Vec3& acceleration_m_s2,
                       const Translation& from) {
    return orbit.model->propagated(orbit, t_s, dt_s, acceleration_m_s2, from);
}

Motion attractor_motion(const Orbit& orbit, const Quat& q_world_attractor, double t_s) {
    const Quat q_world_frame = orbit.q_world_frame(t_s);
    return {{q_world_attractor, q_world_frame * Vec3{-orbit.radius_m, 0, 0}},
            q_world_frame * Vec3{0, -orbit.radius_m * orbit.rate_rad_s(), 0},
            {}};
}

}  // namespace narpa::rehearsal
