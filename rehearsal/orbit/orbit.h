/// rehearsal/orbit/orbit.h - relative motion of the chaser's centre of mass about the target's, which is on a
/// circular orbit, or fixed to the ground of a rotating planet. A model of it is a row of orbit_models().
#pragma once

#include <span>
#include <string_view>

#include "base/pose.h"

namespace narpa::rehearsal {

/// The chaser's centre of mass relative to the target's, world axes (inertial).
struct Translation {
    Vec3 position_m{}, velocity_m_s{};
};

struct Orbit;
struct OrbitModel {
    std::string_view name;  ///< `model` in scenario files
    std::string_view text;  ///< for documents
    bool has_attractor;     ///< which the scene may have as a body
    bool over_ground;       ///< the target is ground of a rotating planet, with J2
    double (*rate_rad_s)(const Orbit&);
    Translation (*propagated)(const Orbit&, double t_s, double dt_s, const Vec3& acceleration_m_s2,
                              const Translation& from);
};
[[nodiscard]] std::span<const OrbitModel> orbit_models();
/// Null: there is no such model.
[[nodiscard]] const OrbitModel* orbit_model(std::string_view name);

struct Orbit {
    const OrbitModel* model = orbit_model("clohessy-wiltshire");
    double radius_m = 6'778'137, mu_m3_s2 = 3.986004418e14;
    Vec3 up{0, 0, 1}, along{1, 0, 0};  ///< world axes at time 0: away from the attractor, and the target's velocity
    /// Over ground: radius_m is the distance of the target's centre of mass from the planet's; `up` points away
    /// from it.
    Vec3 axis{0, 1, 0};  ///< of the planet's rotation, world axes
    double rotation_rad_s = 0, j2 = 0, equatorial_radius_m = 0;

    /// Of the frame of relative motion: 0 without an attractor, that of the planet over ground.
    [[nodiscard]] double rate_rad_s() const { return model->rate_rad_s(*this); }
    /// Rotation from the frame of relative motion (LVLH, or axes that rotate with the planet) to world axes.
    [[nodiscard]] Quat q_world_frame(double t_s) const;
    /// Over ground: gravity at `from_centre_m` of a planet with the given axis of rotation, in the axes of both:
    /// point mass and J2 (O. Montenbruck, E. Gill, Satellite Orbits, 2000, section 3.2).
    [[nodiscard]] Vec3 gravity_m_s2(const Vec3& from_centre_m, const Vec3& unit_axis) const;
    /// Over ground: acceleration of a free body at `position_m` from the target's centre of mass, which moves with
    /// the ground; world axes (inertial).
    [[nodiscard]] Vec3 relative_free_fall_m_s2(double t_s, const Vec3& position_m) const;
};

/// The state dt_s later. `acceleration_m_s2`: by the thrusters, world axes, constant (Clohessy-Wiltshire: constant
/// in LVLH, with the value of mid-step). Free and Clohessy-Wiltshire: exact, in closed form. Two bodies: the
/// target's circular orbit is exact; the gravity difference has the form of R. Battin ("An Introduction to the
/// Mathematics and Methods of Astrodynamics", 1999, section 8.5), which avoids cancellation against the orbit's
/// radius, and is integrated by RK4 in steps of at most a second: error 1e-12 of the distance after an orbit at 400
/// km. Surface: gravity with J2 minus the acceleration of the ground, in the same steps.
[[nodiscard]] Translation propagated(const Orbit& orbit, double t_s, double dt_s, const Vec3& acceleration_m_s2,
                                     const Translation& from);

/// The attractor relative to the target, world axes; it does not rotate.
[[nodiscard]] Motion attractor_motion(const Orbit& orbit, const Quat& q_world_attractor, double t_s);

}  // namespace narpa::rehearsal
