#include "estimator/uncertainty/model_uncertainty.h"

#include <Eigen/Geometry>
#include <cassert>

namespace narpa {

PoseShifts pose_shifts(const ModelUncertainty& u, const Rigid3& T, const ApparentMotion& motion) {
    PoseShifts shifts = PoseShifts::Zero(6, 7);
    shifts.block<3, 3>(3, 0) = u.mesh_m * Eigen::Matrix3d::Identity();
    shifts.block<3, 3>(0, 3) = u.boresight_rad * Eigen::Matrix3d::Identity();
    shifts.block<3, 3>(3, 3) = -u.boresight_rad * skew(to_eigen(T.t));
    shifts.col(6) << u.clock_s * to_eigen(motion.rate_rad_s), u.clock_s * to_eigen(motion.velocity_m_s);
    return shifts;
}

PoseShifts image_shifts(const ModelUncertainty& u, const Rigid3& T, const ApparentMotion& motion,
                        const std::optional<Vector6>& by_focal) {
    // A larger body further away has the same image. A longer focal length makes the body appear nearer: the
    // estimated range grows along the axis while the lateral position stays, and the line of sight, to which
    // estimated attitudes are relative, rotates.
    const Eigen::Vector3d t = to_eigen(T.t), along(0, 0, T.t.z);
    PoseShifts of_camera = PoseShifts::Zero(6, 2);
    of_camera.col(0).tail<3>() = u.scale * t;
    if (by_focal)
        of_camera.col(1) = u.focal * *by_focal;
    else
        of_camera.col(1) << u.focal * t.cross(along) / t.squaredNorm(), u.focal * along;
    return joined(pose_shifts(u, T, motion), of_camera);
}

PoseShifts joined(const PoseShifts& a, const PoseShifts& b) {
    assert(a.cols() + b.cols() <= PoseShifts::MaxColsAtCompileTime);
    PoseShifts all(6, a.cols() + b.cols());
    all << a, b;
    return all;
}

Matrix6 covariance_by(const PoseShifts& shifts) {
    return shifts * shifts.transpose();
}

}  // namespace narpa
