#include "bench/pnp_trial.h"

#include <cmath>

#include "estimator/pose/pnp_bound.h"

namespace narpa {
namespace {

constexpr double kPixels = 500;

Vec3 random_direction(std::mt19937_64& random) {
    std::normal_distribution<double> n;
    return normalized(Vec3{n(random), n(random), n(random)});
}

Quat random_attitude(std::mt19937_64& random) {
    std::normal_distribution<double> n;
    return normalized(Quat{n(random), n(random), n(random), n(random)});
}

/// The body's z axis this far from the line of sight, in any direction, and turned about itself by any angle.
Quat tilted(std::mt19937_64& random, double tilt_min_deg, double tilt_max_deg) {
    std::uniform_real_distribution<double> turn(-M_PI, M_PI), tilt(tilt_min_deg * kDegree, tilt_max_deg * kDegree);
    const double direction = turn(random);
    return exp_rotation(Vec3{std::cos(direction), std::sin(direction), 0} * tilt(random)) *
           exp_rotation({0, 0, turn(random)});
}

Quat attitude(PnpScene scene, std::mt19937_64& random) {
    switch (scene) {
        case PnpScene::half_turn: return exp_rotation(random_direction(random) * (179.9 * kDegree));
        case PnpScene::plane: return tilted(random, 20, 70);
        case PnpScene::plane_facing: return tilted(random, 0, 5);
        case PnpScene::camera_plane: return tilted(random, 0, 10);
        default: return random_attitude(random);
    }
}

/// Half the edges of the box that points are drawn in.
Vec3 half_box_m(const PnpSetting& s) {
    const double half = std::min(2.0, 0.22 * s.range_m);
    switch (s.scene) {
        case PnpScene::plane:
        case PnpScene::plane_facing: return {half, half, 0};
        case PnpScene::line: return {half, 0.03 * half, 0.03 * half};
        case PnpScene::tiny: return {0.7, 0.7, 0.7};
        // Along the line of sight almost to the camera.
        case PnpScene::camera_plane: return {0.02 * s.range_m, 0.02 * s.range_m, 0.95 * s.range_m};
        default: return {half, half, half};
    }
}

}  // namespace

const char* in_words(PnpScene scene) {
    switch (scene) {
        case PnpScene::nominal: return "nominal";
        case PnpScene::half_turn: return "half a turn";
        case PnpScene::plane: return "plane";
        case PnpScene::plane_facing: return "plane, facing";
        case PnpScene::line: return "nearly a line";
        case PnpScene::tiny: return "tiny";
        case PnpScene::camera_plane: return "camera plane";
    }
    return "";
}

std::optional<PnpTrial> draw_trial(const PnpSetting& s, std::mt19937_64& random) {
    std::uniform_real_distribution<double> u(-1, 1);
    std::normal_distribution<double> normal;
    const double focal_px = std::hypot(kPixels / 2, kPixels / 2) / std::tan(15 * kDegree);
    PnpTrial trial;
    trial.camera = {focal_px, focal_px, (kPixels - 1) / 2, (kPixels - 1) / 2};
    trial.sigma_px = s.noise_px;
    const double off_axis = s.scene == PnpScene::camera_plane ? 0 : 0.03;
    trial.T_camera_body = {attitude(s.scene, random),
                           Vec3{off_axis * u(random), off_axis * u(random), 1} * s.range_m};
    const Vec3 half = half_box_m(s);
    const auto n = static_cast<std::size_t>(s.points);
    trial.inliers = n - static_cast<std::size_t>(std::lround(s.outliers * static_cast<double>(n)));
    for (std::size_t i = 0; i < n; ++i) {
        trial.body_m.push_back(Vec3{u(random), u(random), u(random)} * half);
        const Vec3 p = trial.T_camera_body * trial.body_m.back();
        const auto [x, y] = trial.camera.of_plane(p.x / p.z, p.y / p.z);
        Pixel pixel{x + s.noise_px * normal(random), y + s.noise_px * normal(random)};
        if (i >= trial.inliers) pixel = {kPixels * (0.5 + 0.5 * u(random)), kPixels * (0.5 + 0.5 * u(random))};
        trial.pixels.push_back(pixel);
    }
    const auto bound = pnp_bound(
        {trial.camera, {trial.body_m.data(), trial.inliers}, {trial.pixels.data(), trial.inliers}, trial.sigma_px},
        trial.T_camera_body);
    if (!bound) return std::nullopt;
    trial.bound_rotation_rad = rotation_sigma(*bound);
    trial.bound_position_m = position_sigma(*bound);
    return trial;
}

Rigid3 tracked_pose(const PnpTrial& trial, std::mt19937_64& random) {
    return {normalized(exp_rotation(random_direction(random) * kDegree) * trial.T_camera_body.q),
            trial.T_camera_body.t + random_direction(random) * (0.01 * trial.T_camera_body.t.z)};
}

}  // namespace narpa
