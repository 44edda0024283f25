/// estimator/batch/sensor_geometry.h - where a sensor sees the target, as a function of the relative state and of
/// the sensor's mount and clock.
#pragma once

#include "estimator/batch/batch_unknowns.h"
#include "estimator/filter/motion_model.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// A sensor on the chaser at the time stamp of a measurement.
struct SensorPlace {
    Rigid3 T_chaser_sensor{};  ///< by the model
    Quat q_frame_chaser{};     ///< the chaser's attitude then, exact
    Vec3 chaser_rate_rad_s{};  ///< its rate, chaser axes
    BatchUnknown mount_rotation = BatchUnknown::camera_rx,
                 mount_shift = BatchUnknown::camera_x;  ///< first of three
    bool has_clock = false;                             ///< BatchUnknown::clock is that of this sensor
    /// The state is that at the true time of the measurement, not at the time of its stamp.
    bool is_state_when_measured = false;
};

/// T_sensor_target and its derivatives: errors of the pose (pose_estimate.h) by those of the state
/// (motion_model.h), and by the unknowns of mount (rotation, shift), clock and scale.
///
/// A state's position and velocity are in units of the model, of which the true ones are 1 + scale times as many
/// metres. One camera sees the same for every scale, so in metres the motion model's preference for small
/// accelerations would be one for small targets: on a braking approach it moved the scale by seven sigma.
struct SensorView {
    Rigid3 T_sensor_target{};
    UnalignedMatrix<6, 12> by_state = UnalignedMatrix<6, 12>::Zero();
    UnalignedMatrix<6, 6> by_mount = UnalignedMatrix<6, 6>::Zero();
    Vector6 by_clock = Vector6::Zero();
    Vector6 by_scale = Vector6::Zero();
};
[[nodiscard]] SensorView sensor_view(const RelativeState& state, const SensorPlace& place,
                                     const BatchValues& unknowns);

}  // namespace narpa
