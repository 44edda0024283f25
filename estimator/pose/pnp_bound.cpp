#include "estimator/pose/pnp_bound.h"

#include <Eigen/LU>

namespace narpa {

Result<Matrix6> pnp_bound(const PnpInput& input, const Rigid3& T_camera_body) {
    if (const PnpStatus status = check(input); status != PnpStatus::converged) return Error{in_words(status)};
    Matrix6 F = Matrix6::Zero();
    for (std::size_t i = 0; i < input.body_m.size(); ++i) {
        const Vec3 a = T_camera_body.q * input.body_m[i], b = a + T_camera_body.t;
        if (!(b.z > 0)) return Error{in_words(PnpStatus::behind_camera)};
        Eigen::Matrix<double, 2, 3> by_point;
        by_point << input.camera.fx / b.z, 0, -input.camera.fx * b.x / (b.z * b.z),  //
            0, input.camera.fy / b.z, -input.camera.fy * b.y / (b.z * b.z);
        Eigen::Matrix<double, 3, 6> of_point;
        of_point << 0, a.z, -a.y, 1, 0, 0,  //
            -a.z, 0, a.x, 0, 1, 0,          //
            a.y, -a.x, 0, 0, 0, 1;
        Eigen::Matrix2d C = Eigen::Matrix2d::Identity() * (input.sigma_px * input.sigma_px);
        if (!input.covariance_px2.empty()) {
            const PixelCovariance& s = input.covariance_px2[i];
            C << s.uu, s.uv, s.uv, s.vv;
        }
        const Eigen::Matrix<double, 2, 6> J = by_point * of_point;
        F += J.transpose() * C.inverse() * J;
    }
    Matrix6 bound;
    if (!invert_information(F, bound)) return Error{in_words(PnpStatus::degenerate)};
    return bound;
}

}  // namespace narpa
