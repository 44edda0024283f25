#include "dataset/image/image_draw.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/constants.h"
#include "dataset/image/image_random.h"
#include "renderer/scene/mounting.h"

namespace narpa::dataset {
namespace {

/// Two unit vectors that complete `z` to a right-handed set.
struct Frame3 {
    Vec3 x, y;
};
Frame3 axes_about(const Vec3& z) {
    const Vec3 other = std::abs(z.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    const Vec3 x = normalized(cross(other, z));
    return {x, cross(z, x)};
}

/// The unit vector at an angle from `axis` whose cosine is given.
Vec3 at_angle(const Vec3& axis, double cosine, double azimuth_rad) {
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    const auto [x, y] = axes_about(axis);
    return normalized(cosine * axis + sine * (std::cos(azimuth_rad) * x + std::sin(azimuth_rad) * y));
}

template <class Weighted>
std::size_t weighted_choice(const std::vector<Weighted>& all, double u) {
    double sum = 0;
    for (const Weighted& one : all) sum += one.weight;
    double left = u * sum;
    for (std::size_t i = 0; i + 1 < all.size(); ++i)
        if ((left -= all[i].weight) < 0) return i;
    return all.size() - 1;
}

/// The direction to the target's point, whose image is uniform within the margin.
Vec3 place_in_image(const Recipe& recipe, const Camera& camera, const ImageRandom& random) {
    constexpr std::size_t kTries = 16;  // where a lens sees only a part of the image
    const double mx = recipe.margin * camera.width, my = recipe.margin * camera.height;
    ImagePoint p;
    for (std::size_t k = 0; k < kTries; ++k) {
        p = {-0.5 + mx + random.uniform(Purpose::place, 2 * k) * (camera.width - 2 * mx),
             -0.5 + my + random.uniform(Purpose::place, 2 * k + 1) * (camera.height - 2 * my)};
        if (camera.model->sees(p)) break;
    }
    return camera.model->direction(p);
}

/// `line`: from the camera to the target, unit, camera axes.
Quat attitude_in_cone(const AttitudeCone& cone, const Vec3& line, const ImageRandom& random) {
    const double cosine = 1 - random.uniform(Purpose::attitude, 0) * (1 - std::cos(cone.half_angle_rad));
    const Vec3 forward = -at_angle(cone.axis, cosine, 2 * kPi * random.uniform(Purpose::attitude, 1));
    const Vec3 sideways = cross(forward, cone.up);
    const Vec3 right = norm(sideways) > 1e-9 ? normalized(sideways) : axes_about(forward).x;
    const double roll_rad = kRadPerDeg * cone.roll_deg.at(random.uniform(Purpose::attitude, 2));
    const Quat q_target_camera = camera_attitude(forward, right) * exp_rotation({0, 0, roll_rad});
    return normalized(shortest_rotation({0, 0, 1}, line) * conjugate(q_target_camera));
}

/// Draws the Sun, and with it the camera's attitude in the world. `line`: from the camera to the target's point.
void draw_sun(const Recipe& recipe, const SceneFacts& facts, const Vec3& line, const ImageRandom& random,
              ImageDraw& d) {
    if (!facts.sun_world) {
        d.q_world_camera =
            uniform_attitude(random.uniform(Purpose::camera_roll, 0), random.uniform(Purpose::camera_roll, 1),
                             random.uniform(Purpose::camera_roll, 2));
        return;
    }
    const Vec3 to_camera = -line;
    const double u = random.uniform(Purpose::sun, 0);
    const double cosine = recipe.phase_deg ? std::cos(kRadPerDeg * recipe.phase_deg->at(u)) : 1 - 2 * u;
    const Vec3 sun = at_angle(to_camera, cosine, 2 * kPi * random.uniform(Purpose::sun, 1));
    const double roll_rad = 2 * kPi * random.uniform(Purpose::camera_roll);
    d.sun_camera = sun;
    d.phase_rad = std::atan2(norm(cross(to_camera, sun)), dot(to_camera, sun));
    d.q_world_camera =
        normalized(exp_rotation(roll_rad * *facts.sun_world) * shortest_rotation(sun, *facts.sun_world));
}

}  // namespace

Quat uniform_attitude(double u1, double u2, double u3) {
    const double a = std::sqrt(1 - u1), b = std::sqrt(u1);
    return normalized(Quat{a * std::sin(2 * kPi * u2), a * std::cos(2 * kPi * u2), b * std::sin(2 * kPi * u3),
                           b * std::cos(2 * kPi * u3)});
}

Quat shortest_rotation(const Vec3& from, const Vec3& to) {
    const double cosine = dot(from, to);
    if (cosine < -1 + 1e-12) {
        const Vec3 axis = axes_about(from).x;  // half a turn about any axis across
        return {0, axis.x, axis.y, axis.z};
    }
    const Vec3 axis = cross(from, to);
    return normalized(Quat{1 + cosine, axis.x, axis.y, axis.z});
}

Distribution default_range_m(const Camera& camera, double target_radius_m) {
    constexpr double kLargest = 0.9, kSmallest = 0.15;
    const double side_px = std::min(camera.width, camera.height);
    const double range_of_side_m = 2 * target_radius_m * camera.model->pixels_per_radian() / side_px;
    return log_uniform_between(range_of_side_m / kLargest, range_of_side_m / kSmallest);
}

ImageDraw draw_image(const Recipe& recipe, const SceneFacts& facts, std::uint32_t image) {
    const ImageRandom random(recipe.seed, image);
    const auto factor = [&](const std::optional<Distribution>& d, Purpose purpose) {
        return d ? d->at(random.uniform(purpose)) : 1.0;
    };
    ImageDraw d;
    d.variant = weighted_choice(recipe.variants, random.uniform(Purpose::variant));
    d.backdrop = weighted_choice(recipe.backdrops, random.uniform(Purpose::backdrop));
    d.range_m = facts.range_m->at(random.uniform(Purpose::range));
    const Vec3 line = place_in_image(recipe, *facts.camera, random);
    d.T_camera_target.q =
        recipe.cone ? attitude_in_cone(*recipe.cone, line, random)
                    : uniform_attitude(random.uniform(Purpose::attitude, 0), random.uniform(Purpose::attitude, 1),
                                       random.uniform(Purpose::attitude, 2));
    d.T_camera_target.t = d.range_m * line - d.T_camera_target.q * facts.point_m;
    draw_sun(recipe, facts, line, random, d);
    d.time_factor = factor(recipe.time_factor, Purpose::exposure_time);
    d.gain_factor = factor(recipe.gain_factor, Purpose::gain);
    d.albedo_factor = factor(recipe.albedo_factor, Purpose::albedo);
    const double radius = std::sqrt(random.uniform(Purpose::backdrop_pose, 0)),
                 angle = 2 * kPi * random.uniform(Purpose::backdrop_pose, 1);
    d.backdrop_offset = {radius * std::cos(angle), radius * std::sin(angle), 0};
    d.q_world_backdrop =
        uniform_attitude(random.uniform(Purpose::backdrop_pose, 2), random.uniform(Purpose::backdrop_pose, 3),
                         random.uniform(Purpose::backdrop_pose, 4));
    return d;
}

}  // namespace narpa::dataset
