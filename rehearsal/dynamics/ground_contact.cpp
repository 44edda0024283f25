#include "rehearsal/dynamics/ground_contact.h"

#include <algorithm>
#include <limits>

#include "rehearsal/contact/landing.h"

namespace narpa::rehearsal {

double GroundContact::clearance_m(const PortState& lander) const {
    double least = std::numeric_limits<double>::infinity();
    for (const Vec3& foot : feet_at_site(gear_.feet_m, lander))
        if (const auto ground = terrain_->below(foot)) least = std::min(least, foot.x - ground->height_m);
    return least;
}

GroundForces GroundContact::press(const PortState& lander) {
    GroundForces sum;
    const std::vector<Vec3> feet = feet_at_site(gear_.feet_m, lander);
    const Vec3 rate = lander.T_port_chaser_port.q * lander.rate_rad_s;
    for (std::size_t i = 0; i < feet.size(); ++i) {
        const Vec3& foot = feet[i];
        const auto ground = terrain_->below(foot);
        const double deep_m = ground ? (ground->height_m - foot.x) * ground->normal.x : -1;
        if (deep_m <= 0) {
            held_[i].reset();
            continue;
        }
        sum.deepest_m = std::max(sum.deepest_m, deep_m);
        const Vec3& up = ground->normal;
        const auto along_ground = [&](const Vec3& v) { return v - dot(v, up) * up; };
        const Vec3 arm = foot - lander.position_m(), velocity = lander.velocity_m_s + cross(rate, arm);
        const double push_n = std::max(0.0, gear_.stiffness_n_m * deep_m - gear_.damping_n_s_m * dot(velocity, up));
        if (!held_[i]) held_[i] = foot;
        Vec3 across =
            -gear_.stiffness_n_m * along_ground(foot - *held_[i]) - gear_.damping_n_s_m * along_ground(velocity);
        const double most_n = gear_.friction * push_n;
        if (const double n = norm(across); n > most_n) {  // slips: the anchor point follows the foot
            across = across * (most_n / n);
            held_[i] = foot + across / gear_.stiffness_n_m;
        }
        const Vec3 force = push_n * up + across;
        sum.force_n += force;
        sum.torque_n_m += cross(arm, force);
    }
    return sum;
}

}  // namespace narpa::rehearsal
