// tests/estimator/pnp/pnp_support.h - bodies of points, and how a camera with noise sees them.
#pragma once

#include <random>
#include <vector>

#include "estimator/pnp/pnp_points.h"
#include "tests/support/shapes.h"

namespace narpa::test {

inline const Pinhole kPaperCamera{1319.4792168823421, 1319.4792168823421, 249.5, 249.5};

/// In a cube of edges 2 * half.
inline std::vector<Vec3> random_points(std::mt19937_64& random, std::size_t n, double half_m) {
    std::uniform_real_distribution<double> u(-half_m, half_m);
    std::vector<Vec3> points(n);
    for (Vec3& p : points) p = {u(random), u(random), u(random)};
    return points;
}

inline Pixel project(const Pinhole& c, const Vec3& p) {
    return {c.fx * p.x / p.z + c.cx, c.fy * p.y / p.z + c.cy};
}

/// What a camera sees of a body at a known pose.
struct Seen {
    Pinhole camera = kPaperCamera;
    Rigid3 T_camera_body{};
    std::vector<Vec3> body_m;
    std::vector<Pixel> pixels;
    double sigma_px = 1;

    [[nodiscard]] PnpInput input() const { return {&camera, body_m, pixels, sigma_px}; }
};

/// sigma_px 0: exact pixels, for which the solver gets 1 px.
inline Seen see(std::mt19937_64& random, std::vector<Vec3> points, const Rigid3& T_camera_body, double sigma_px) {
    std::normal_distribution<double> n;
    Seen seen{kPaperCamera, T_camera_body, std::move(points), {}, sigma_px > 0 ? sigma_px : 1.0};
    for (const Vec3& p : seen.body_m) {
        Pixel pixel = project(seen.camera, T_camera_body * p);
        pixel.u += sigma_px * n(random), pixel.v += sigma_px * n(random);
        seen.pixels.push_back(pixel);
    }
    return seen;
}

/// A pose that is off by this angle about some axis, and by this part of the range in some direction.
inline Rigid3 pose_off_by(std::mt19937_64& random, const Rigid3& T, double angle_rad, double part_of_range) {
    return {normalized(exp_rotation(random_direction(random) * angle_rad) * T.q),
            T.t + random_direction(random) * (part_of_range * norm(T.t))};
}

}  // namespace narpa::test
