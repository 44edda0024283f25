#include "tests/estimator/pnp/crp.h"

#include <Eigen/Geometry>

namespace narpa {
namespace {

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
    Eigen::Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
}

}  // namespace

Eigen::Matrix3d crp_matrix(const Eigen::Vector3d& q) {
    const Eigen::Vector3d s = q.cwiseAbs2();
    const double d = 1 / (1 + s.sum());
    Eigen::Matrix3d R;
    R << 1 + s[0] - s[1] - s[2], 2 * (q[0] * q[1] + q[2]), 2 * (q[0] * q[2] - q[1]),  //
        2 * (q[1] * q[0] - q[2]), 1 - s[0] + s[1] - s[2], 2 * (q[1] * q[2] + q[0]),   //
        2 * (q[2] * q[0] + q[1]), 2 * (q[2] * q[1] - q[0]), 1 - s[0] - s[1] + s[2];
    return R * d;
}

Eigen::Matrix<double, 9, 3> crp_matrix_derivative(const Eigen::Vector3d& q) {
    const double d = 2 / (1 + q.squaredNorm());
    const Eigen::Matrix3d R_plus_1 = crp_matrix(q) + Eigen::Matrix3d::Identity();
    Eigen::Matrix<double, 9, 3> derivative;
    for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d e = Eigen::Vector3d::Unit(k);
        const Eigen::Matrix3d m = d * (e * q.transpose() + q * e.transpose() - cross_matrix(e) - q[k] * R_plus_1);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) derivative(3 * i + j, k) = m(i, j);
    }
    return derivative;
}

Quat quaternion_from_crp(const Eigen::Vector3d& q) {
    return normalized(Quat{1, -q[0], -q[1], -q[2]});
}

Eigen::Vector3d crp_from_quaternion(const Quat& q) {
    return {-q.x / q.w, -q.y / q.w, -q.z / q.w};
}

ProjectionVector projection_vector(const Eigen::Vector3d& q, const Eigen::Vector3d& t_m, double f_px) {
    const Eigen::Matrix3d R = crp_matrix(q);
    ProjectionVector h;
    for (int i = 0; i < 3; ++i) h.segment<4>(4 * i) << R.row(i).transpose(), t_m[i];
    h.head<8>() *= f_px;
    return h;
}

Eigen::Matrix<double, 12, 6> projection_vector_derivative(const Eigen::Vector3d& q, double f_px) {
    const Eigen::Matrix<double, 9, 3> dR = crp_matrix_derivative(q);
    Eigen::Matrix<double, 12, 6> J = Eigen::Matrix<double, 12, 6>::Zero();
    for (int i = 0; i < 3; ++i) {
        J.block<3, 3>(4 * i, 0) = dR.middleRows<3>(3 * i);
        J(4 * i + 3, 3 + i) = 1;
    }
    J.topRows<8>() *= f_px;
    return J;
}

Eigen::VectorXd image_points(const ProjectionVector& h, std::span<const Vec3> points_m) {
    Eigen::VectorXd uv(2 * static_cast<Eigen::Index>(points_m.size()));
    Eigen::Index row = 0;
    for (const Vec3& p : points_m) {
        const Eigen::Vector4d a(p.x, p.y, p.z, 1);
        const double s = h.tail<4>().dot(a);
        uv[row++] = h.head<4>().dot(a) / s;
        uv[row++] = h.segment<4>(4).dot(a) / s;
    }
    return uv;
}

Eigen::Matrix<double, Eigen::Dynamic, 12> image_points_derivative(const ProjectionVector& h,
                                                                  std::span<const Vec3> points_m) {
    Eigen::Matrix<double, Eigen::Dynamic, 12> J(2 * static_cast<Eigen::Index>(points_m.size()), 12);
    J.setZero();
    Eigen::Index row = 0;
    for (const Vec3& p : points_m) {
        const Eigen::RowVector4d a(p.x, p.y, p.z, 1);
        const double s = a.dot(h.tail<4>());
        for (int axis = 0; axis < 2; ++axis, ++row) {
            J.block<1, 4>(row, 4 * axis) = a / s;
            J.block<1, 4>(row, 8) = a * (-a.dot(h.segment<4>(4 * axis)) / (s * s));
        }
    }
    return J;
}

}  // namespace narpa
