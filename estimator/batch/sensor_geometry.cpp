#include "estimator/batch/sensor_geometry.h"

#include <Eigen/Geometry>

namespace narpa {

SensorView sensor_view(const RelativeState& state, const SensorPlace& place, const BatchValues& unknowns) {
    // From the time of the stamp to the true one.
    const double later_s = place.has_clock ? -at(unknowns, BatchUnknown::clock) : 0;
    const double state_later_s = place.is_state_when_measured ? 0 : later_s;
    const Quat q_chaser_frame = conjugate(place.q_frame_chaser * exp_rotation(later_s * place.chaser_rate_rad_s));
    const Quat q_target = state.q_frame_target * exp_rotation(state_later_s * state.rate_rad_s);
    const double size = 1 + at(unknowns, BatchUnknown::scale);
    const Vec3 model_m = q_chaser_frame * (state.position_m + state_later_s * state.velocity_m_s);  // chaser axes
    const Vec3 target_m = size * model_m;

    const Vec3 turn = vector_at(unknowns, place.mount_rotation), shift = vector_at(unknowns, place.mount_shift);
    const Quat q_sensor_chaser = conjugate(place.T_chaser_sensor.q * exp_rotation(turn));
    SensorView view;
    Rigid3& T = view.T_sensor_target;
    T.q = normalized(q_sensor_chaser * q_chaser_frame * q_target);
    T.t = q_sensor_chaser * (target_m - place.T_chaser_sensor.t - shift);

    const Eigen::Matrix3d sensor_chaser = rotation_matrix(q_sensor_chaser);
    const Eigen::Matrix3d sensor_frame = sensor_chaser * rotation_matrix(q_chaser_frame);
    const Eigen::Matrix3d sensor_target = rotation_matrix(T.q);
    view.by_state.block<3, 3>(3, 0) = size * sensor_frame;
    view.by_state.block<3, 3>(3, 3) = size * state_later_s * sensor_frame;
    view.by_state.block<3, 3>(0, 6) = sensor_frame * rotation_matrix(state.q_frame_target);
    view.by_state.block<3, 3>(0, 9) = state_later_s * sensor_target;

    // exp(turn + d) = exp(turn) exp(J d), J = 1 - turn x / 2 to first order.
    const Eigen::Matrix3d turned = Eigen::Matrix3d::Identity() - 0.5 * skew(to_eigen(turn));
    view.by_mount.block<3, 3>(0, 0) = -turned;
    view.by_mount.block<3, 3>(3, 0) = skew(to_eigen(T.t)) * turned;
    view.by_mount.block<3, 3>(3, 3) = -sensor_chaser;

    const Eigen::Vector3d chaser_rate = to_eigen(place.chaser_rate_rad_s);
    view.by_clock.head<3>() = sensor_chaser * chaser_rate;
    view.by_clock.tail<3>() = sensor_chaser * chaser_rate.cross(to_eigen(target_m));
    if (!place.is_state_when_measured) {
        view.by_clock.head<3>() -= sensor_target * to_eigen(state.rate_rad_s);
        view.by_clock.tail<3>() -= size * sensor_frame * to_eigen(state.velocity_m_s);
    }
    view.by_scale.tail<3>() = sensor_chaser * to_eigen(model_m);
    return view;
}

}  // namespace narpa
