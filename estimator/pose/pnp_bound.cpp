#include "estimator/pose/pnp_bound.h"

#include <Eigen/LU>

#include "estimator/pose/reprojection.h"

namespace narpa {

Result<Matrix6> pnp_bound(const PnpInput& input, const Rigid3& T_camera_body) {
    if (const PnpStatus status = check(input); status != PnpStatus::converged) return Error{in_words(status)};
    Matrix6 F = Matrix6::Zero();
    for (std::size_t i = 0; i < input.body_m.size(); ++i) {
        if (!input.camera->project(T_camera_body * input.body_m[i]))
            return Error{in_words(PnpStatus::behind_camera)};
        Eigen::Matrix2d C = Eigen::Matrix2d::Identity() * (input.sigma_px * input.sigma_px);
        if (!input.covariance_px2.empty()) {
            const PixelCovariance& s = input.covariance_px2[i];
            C << s.uu, s.uv, s.uv, s.vv;
        }
        const Matrix26 J = reprojection_jacobian(*input.camera, T_camera_body, input.body_m[i]);
        F += J.transpose() * C.inverse() * J;
    }
    Matrix6 bound;
    if (!invert_information(F, bound)) return Error{in_words(PnpStatus::degenerate)};
    return bound;
}

}  // namespace narpa
