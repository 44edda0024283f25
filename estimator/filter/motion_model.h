/// estimator/filter/motion_model.h - relative motion of a target and a chaser: propagation of state and covariance.
///
/// The frame is either inertial or LVLH, that of W. Clohessy and R. Wiltshire (1960): x up, away from the Earth, y
/// along the circular orbit, z along its angular momentum; it rotates about z with the orbit's rate. Its origin is
/// the chaser. Over a planet's ground the frame rotates with the planet, whose axis is z.
#pragma once

#include <cstdint>
#include <optional>

#include "base/result.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa {

using Vector12 = UnalignedMatrix<12, 1>;
using Matrix12 = UnalignedMatrix<12, 12>;

/// The target relative to the chaser; origins are the centres of mass.
struct RelativeState {
    Vec3 position_m{};      ///< of the target's origin from the chaser's, frame axes
    Vec3 velocity_m_s{};    ///< its rate of change as the frame sees it
    Quat q_frame_target{};  ///< target axes to frame axes
    Vec3 rate_rad_s{};      ///< of the target against inertial space, target axes

    friend bool operator==(const RelativeState&, const RelativeState&) = default;
};

/// An error is (position m, velocity m/s, attitude rad, rate rad/s), the first two in frame axes, the others in the
/// target's: the truth's attitude is q_frame_target * exp_rotation(attitude).
[[nodiscard]] RelativeState displaced(const RelativeState& state, const Vector12& error);
[[nodiscard]] Vector12 error_between(const RelativeState& from, const RelativeState& to);
/// e' C^-1 e: chi-square with twelve degrees of freedom where the covariance is right; infinite where it is not
/// positive definite.
[[nodiscard]] double normalised_error_squared(const Vector12& error, const Matrix12& covariance);

/// For a target that is ground to which the chaser falls: gravity plus centrifugal acceleration, linear about the
/// target.
struct GroundField {
    Vec3 gravity_m_s2{};                                    ///< at the target, frame axes
    Eigen::Matrix3d gradient_s2 = Eigen::Matrix3d::Zero();  ///< change of `gravity_m_s2` with the chaser's position
};

struct MotionModel {
    /// 0: a free body, the frame is inertial, velocities stay. > 0: Clohessy and Wiltshire's equations, frame LVLH;
    /// with `ground` the planet's rotation.
    double orbit_rate_rad_s = 0;
    std::optional<GroundField> ground{};
    /// Inertia of the target about its centre of mass in its body axes: it tumbles as a rigid body without a
    /// torque. None: its rate is constant in its own axes.
    std::optional<Eigen::Matrix3d> inertia_kg_m2{};
    /// Process noise: power spectral densities of white noise, on each axis, of acceleration
    /// (m^2 s^-3) and of angular acceleration (rad^2 s^-3).
    double acceleration_psd = 1e-8;
    double angular_acceleration_psd = 1e-10;
};
/// An Error names the field, what it is and what was expected.
[[nodiscard]] Status check(const MotionModel& model);

/// One step of a rigid body under a constant torque, body axes: rates by Runge and Kutta, attitude by the
/// fourth-order Magnus expansion (A. Iserles, S. Norsett, 1999).
struct RotationStep {
    Eigen::Vector3d rate_rad_s, mid_rate_rad_s;  ///< at the end and in the middle
    Eigen::Vector3d turn_rad;                    ///< rotation vector
};
[[nodiscard]] RotationStep rotation_step(const Eigen::Matrix3d& inertia, const Eigen::Matrix3d& inverse,
                                         const Eigen::Vector3d& torque_n_m, const Eigen::Vector3d& rate_rad_s,
                                         double dt_s);

/// Propagates state and covariance by dt_s >= 0. `acceleration_m_s2`: known, of the target relative to the chaser,
/// frame axes, constant. Allocates nothing.
void propagate(const MotionModel& model, double dt_s, const Vec3& acceleration_m_s2, RelativeState& state,
               Matrix12& covariance);

/// Transition matrix of (position, velocity) under Clohessy and Wiltshire's equations, closed form.
/// orbit_rate_rad_s > 0.
[[nodiscard]] Matrix6 clohessy_wiltshire_transition(double orbit_rate_rad_s, double dt_s);

}  // namespace narpa
