/// estimator/batch/batch_unknowns.h - the unknowns that all frames and sweeps of a run have in common: a table with
/// one row each.
///
/// A value is the change from the model to the truth: 0 if the model is exact.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/pose.h"

namespace narpa {

enum class BatchUnknown : std::uint8_t {
    scale,     ///< of the target's size about its origin: truth / model - 1
    focal,     ///< of the focal lengths: truth / model - 1
    aspect,    ///< of fy / fx: truth / model - 1
    centre_x,  ///< of the principal point, px
    centre_y,  ///
    /// Coefficients of distortion (brown_conrady.h): added to those of a camera with that model or with none; of
    /// other models, a distortion before the model's own.
    k1,
    k2,
    p1,
    p2,
    k3,
    camera_rx,  ///< rotation of the camera on the chaser, rad, about its own axes
    camera_ry,  ///
    camera_rz,  ///
    camera_x,   ///< shift of the camera, m, in the chaser's axes
    camera_y,   ///
    camera_z,   ///
    lidar_rx,   ///< as those of the camera
    lidar_ry,   ///
    lidar_rz,   ///
    lidar_x,    ///
    lidar_y,    ///
    lidar_z,    ///
    /// Time stamp minus true time, s: of the LiDAR if the camera is used too, whose clock is then right; else of
    /// the only sensor.
    clock,
    range_bias,  ///< measured minus true range, m
    albedo,      ///< of the target's brightness: truth / model - 1
    light_x,     ///< rotation of the Sun's direction, rad, about light_axes()
    light_y,     ///
};
inline constexpr std::size_t kBatchUnknowns = 27;

/// By BatchUnknown; SI units.
using BatchValues = std::array<double, kBatchUnknowns>;

[[nodiscard]] constexpr double& at(BatchValues& values, BatchUnknown u) {
    return values[static_cast<std::size_t>(u)];
}
[[nodiscard]] constexpr double at(const BatchValues& values, BatchUnknown u) {
    return values[static_cast<std::size_t>(u)];
}
/// Three values from this one on.
[[nodiscard]] constexpr Vec3 vector_at(const BatchValues& values, BatchUnknown first) {
    const auto i = static_cast<std::size_t>(first);
    return {values[i], values[i + 1], values[i + 2]};
}

struct BatchUnknownRow {
    std::string_view name;     ///< in options and results, GROUP or GROUP.AXIS; GROUP alone names all of its axes
    double unit = 1;           ///< SI value of 1 in options and results
    double default_sigma = 0;  ///< prior standard deviation in `unit`
    bool by_default = false;   ///< estimated if the user names no unknowns
    bool of_camera = false, of_lidar = false;  ///< changes what this sensor measures
};
[[nodiscard]] std::span<const BatchUnknownRow, kBatchUnknowns> batch_unknowns() noexcept;
/// The group of a name: all before the point.
[[nodiscard]] std::string_view group_of(std::string_view name) noexcept;
/// Names of the groups with the default standard deviations of those estimated by default, for --help.
[[nodiscard]] std::string help_of_batch_unknowns();

/// Two unit vectors, perpendicular to each other and to a direction: the first horizontal, unless the direction is
/// within 30 degrees of the z axis.
[[nodiscard]] std::array<Vec3, 2> light_axes(const Vec3& direction);

/// Prior standard deviations, SI; 0: known, not estimated.
[[nodiscard]] BatchValues default_batch_priors();

/// The same with default standard deviations for all.
[[nodiscard]] BatchValues all_batch_priors();

/// True if an unknown changes what is measured by the sensors that there are.
[[nodiscard]] bool is_of_sensors(const BatchUnknownRow& row, bool camera, bool lidar) noexcept;

}  // namespace narpa
