/// bench/pnp_trial.h - random trials of poses from points: a body of points at a pose, and their noisy pixels.
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "estimator/pose/pnp_points.h"

namespace narpa {

enum class PnpScene : std::uint8_t { nominal, half_turn, plane, plane_facing, line, tiny, camera_plane };
[[nodiscard]] const char* in_words(PnpScene scene);

struct PnpSetting {
    PnpScene scene = PnpScene::nominal;
    int points = 10;
    double noise_px = 0.5;
    double range_m = 30;
    double outliers = 0;  ///< fraction of the points whose pixels are uniform over the image
};

/// One trial. Camera of the paper: 500 x 500 pixels, 30 degrees across the diagonal.
struct PnpTrial {
    Pinhole camera;
    Rigid3 T_camera_body{};
    std::vector<Vec3> body_m;
    std::vector<Pixel> pixels;
    double sigma_px = 1;
    std::size_t inliers = 0;  ///< the first points
    /// The Cramer-Rao bound of the inliers: roots of the summed variances of rotation and position.
    double bound_rotation_rad = 0, bound_position_m = 0;

    [[nodiscard]] PnpInput input() const { return {camera, body_m, pixels, sigma_px}; }
};

/// None where the points do not determine the pose or lie behind the camera: draw again.
[[nodiscard]] std::optional<PnpTrial> draw_trial(const PnpSetting& setting, std::mt19937_64& random);

/// The true pose with an error of one degree and one percent of the range: a tracker's prediction.
[[nodiscard]] Rigid3 tracked_pose(const PnpTrial& trial, std::mt19937_64& random);

}  // namespace narpa
