/// estimator/view/row_times.h - when the rows of a frame are exposed.
#pragma once

#include <span>

#include "base/camera_pose.h"
#include "estimator/pnp/pnp_points.h"
#include "estimator/pose/apparent_motion.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Seconds from the middle of the frame's exposure, the time of its pose. All 0: all rows at that instant.
struct RowTimes {
    double middle_s = 0;    ///< of the first row's exposure
    double row_s = 0;       ///< from the middle of a row's to the next one's
    double exposure_s = 0;  ///< of each row

    [[nodiscard]] bool at_once() const noexcept { return row_s == 0 && exposure_s == 0; }
    [[nodiscard]] double at(double row) const noexcept { return middle_s + row * row_s; }
    /// Times of the rows from this one on.
    [[nodiscard]] RowTimes from(double row) const noexcept { return {at(row), row_s, exposure_s}; }
    /// Times of an image whose rows are each `factor` of these; below 1: parts of a row.
    [[nodiscard]] RowTimes scaled(double factor) const noexcept;
    /// Each row's exposure shortened to part k of n.
    [[nodiscard]] RowTimes part(int k, int n) const noexcept;
};

/// All 0 without a shutter: every frame is of one moment (Camera::shutter).
[[nodiscard]] RowTimes row_times(const Camera& camera);

/// The camera's path during the exposure of these rows, where it sees the target at T_camera_target in the middle
/// of the frame's exposure. The target stands still.
[[nodiscard]] CameraPose camera_path(const Rigid3& T_world_target, const Rigid3& T_camera_target,
                                     const ApparentMotion& motion, const RowTimes& times, int rows);

/// Corrects body points for a rolling shutter: moves each point, measured at its pixel in a row with its own
/// exposure time, so that a camera exposing all rows at mid-exposure would see it at the same pixel. For solvers
/// with one pose per frame (pnp.h): solve, move the points with that pose, and solve again. The spans have equal
/// lengths.
void to_mid_exposure(const Rigid3& T_camera_target, const ApparentMotion& motion, const RowTimes& times,
                     std::span<const Pixel> pixels, std::span<Vec3> body_m) noexcept;

}  // namespace narpa
