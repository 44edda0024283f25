#include "estimator/stereo/triangulation.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "estimator/pnp/pnp_points.h"

namespace narpa {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

constexpr int kNewtonStepsMax = 20, kHalvingsMax = 10;
/// A difference below this part of its terms is rounding.
constexpr double kRounding = 1e-12;

/// Direction of a pixel's ray, z = 1.
Vector3d ray_through(const CameraModel& camera, const Vector2d& px) {
    return to_eigen(camera.on_plane({px.x(), px.y()}));
}

/// Image of the line through the camera's centre and the point, which may be behind it; not finite if there is
/// none.
Vector2d image_of_line(const CameraModel& camera, const Vector3d& p) {
    const auto image = camera.project(to_vec3(p.z() < 0 ? Vector3d(-p) : p));
    return image ? Vector2d(image->x, image->y) : Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}
Matrix23 jacobian_of_line(const CameraModel& camera, const Vector3d& p) {
    const double sign = p.z() < 0 ? -1 : 1;
    return sign * to_eigen(camera.jacobian(to_vec3(sign * p)));
}

bool is_usable(const Camera& camera) {
    return camera.model && camera.model->is_valid();
}
bool is_usable(const StereoPair& pair) {
    const Rigid3& T = pair.T_right_left;
    return is_usable(pair.left) && is_usable(pair.right) && is_finite(T.t) && std::abs(norm(T.q) - 1) < 1e-6;
}

bool is_usable(const PixelMeasurement& m) {
    return m.px.allFinite() && m.covariance_px2.allFinite() && m.covariance_px2(0, 0) > 0 &&
           m.covariance_px2.determinant() > 0;
}

/// The state is (x / z, y / z, 1 / z) of the point in the left frame.
class TwoViews {
public:
    TwoViews(const StereoPair& pair, const PixelMeasurement& left, const PixelMeasurement& right)
        : left_(pair.left.model),
          right_(pair.right.model),
          left_px_(left.px),
          right_px_(right.px),
          R_(rotation_matrix(pair.T_right_left.q)),
          t_(to_eigen(pair.T_right_left.t)),
          left_weight_(left.covariance_px2.inverse()),
          right_weight_(right.covariance_px2.inverse()) {}

    /// Point of the left ray closest to the right one, by the angle seen from the right camera.
    [[nodiscard]] Vector3d first_guess() const {
        const Vector3d l = ray_through(*left_, left_px_), r = ray_through(*right_, right_px_);
        const Vector3d turned = r.cross(R_ * l), moved = r.cross(t_);
        const double squared = moved.squaredNorm();
        return {l.x(), l.y(), squared > 0 ? -moved.dot(turned) / squared : 0};
    }

    /// The point in the right camera's frame, times the inverse depth in the left one.
    [[nodiscard]] Vector3d in_right(const Vector3d& s) const { return R_ * Vector3d(s.x(), s.y(), 1) + s.z() * t_; }

    [[nodiscard]] double cost(const Vector3d& s) const {
        const Vector2d l = left_residual(s), r = right_residual(s);
        return l.dot(left_weight_ * l) + r.dot(right_weight_ * r);
    }

    void linearise(const Vector3d& s, Matrix3d& information, Vector3d& gradient) const {
        Matrix23 J_left = to_eigen(left_->jacobian({s.x(), s.y(), 1}));
        J_left.col(2).setZero();  // by the inverse depth
        Matrix3d J_point;
        J_point << R_.col(0), R_.col(1), t_;
        const Matrix23 J_right = jacobian_of_line(*right_, in_right(s)) * J_point;
        information = J_left.transpose() * left_weight_ * J_left + J_right.transpose() * right_weight_ * J_right;
        gradient = J_left.transpose() * left_weight_ * left_residual(s) +
                   J_right.transpose() * right_weight_ * right_residual(s);
    }

private:
    [[nodiscard]] Vector2d left_residual(const Vector3d& s) const {
        return left_px_ - image_of_line(*left_, {s.x(), s.y(), 1});
    }
    [[nodiscard]] Vector2d right_residual(const Vector3d& s) const {
        return right_px_ - image_of_line(*right_, in_right(s));
    }

    std::shared_ptr<const CameraModel> left_, right_;
    Vector2d left_px_, right_px_;
    Matrix3d R_;
    Vector3d t_;
    Matrix2d left_weight_, right_weight_;
};

/// Solves information * x = b; false where it is singular. Both pixels see the direction, so only the depth, the
/// last of the three, can be missing.
bool solve(const Matrix3d& information, const Matrix3d& b, Matrix3d& x) {
    const Eigen::LLT<Matrix3d> factors(information);
    if (factors.info() != Eigen::Success) return false;
    x = factors.solve(b);
    return x.allFinite();
}

/// The covariance of (x, y, z), given that of (x / z, y / z, 1 / z).
Matrix3d point_covariance(const Vector3d& s, const Matrix3d& C) {
    const double z = 1 / s.z();
    Matrix3d J;
    J << z, 0, -s.x() * z * z,  //
        0, z, -s.y() * z * z,   //
        0, 0, -z * z;
    return J * C * J.transpose();
}

}  // namespace

TriangulatedPoint triangulate(const StereoPair& pair, const PixelMeasurement& left, const PixelMeasurement& right) {
    TriangulatedPoint out;
    if (!is_usable(pair) || !is_usable(left) || !is_usable(right)) return out;
    out.status = TriangulationStatus::no_parallax;
    out.sigma_inverse_depth_1_m = std::numeric_limits<double>::infinity();

    const TwoViews views(pair, left, right);
    Vector3d s = views.first_guess(), gradient;
    Matrix3d information, C;
    double cost = views.cost(s);
    for (int i = 0; i < kNewtonStepsMax; ++i) {
        views.linearise(s, information, gradient);
        if (!solve(information, Matrix3d::Identity(), C)) return out;
        Vector3d step = C * gradient;
        double next = views.cost(s + step);
        for (int k = 0; k < kHalvingsMax && !(next < cost); ++k) next = views.cost(s + (step *= 0.5));
        if (!(next < cost)) break;
        s += step;
        cost = next;
    }
    views.linearise(s, information, gradient);
    if (!std::isfinite(cost) || !solve(information, Matrix3d::Identity(), C)) return out;

    out.inverse_depth_1_m = s.z();
    out.sigma_inverse_depth_1_m = std::sqrt(C(2, 2));
    out.epipolar_sigmas = std::sqrt(cost);
    if (!(std::abs(s.z()) >= kMinParallax_sigmas * out.sigma_inverse_depth_1_m)) return out;
    const bool before_both = s.z() > 0 && views.in_right(s).z() > 0;
    out.status = before_both ? TriangulationStatus::good : TriangulationStatus::behind_camera;
    out.point_m = Vector3d(s.x(), s.y(), 1) / s.z();
    out.covariance_m2 = point_covariance(s, C);
    return out;
}

Result<double> printed_depth_m(const StereoPair& pair, const Vector2d& left_px, const Vector2d& right_px) {
    if (!is_usable(pair) || !left_px.allFinite() || !right_px.allFinite())
        return Error{"a stereo pair or a pixel that is not finite, expected numbers"};
    const Eigen::Array3d l = ray_through(*pair.left.model, left_px);
    const Pinhole* right = pair.right.model->pinhole();
    if (right == nullptr) return Error{"a right camera that is not a pinhole, expected one for this formula"};
    const double U_r = right_px.x() - right->cx, f_r = right->fx;
    const Matrix3d R = rotation_matrix(pair.T_right_left.q);
    const Vec3& t = pair.T_right_left.t;
    const Eigen::Array3d column = f_r * R.row(0).transpose().array() * l;
    const Eigen::Array3d depth = U_r * R.row(2).transpose().array() * l;
    const double above = t.z * U_r - f_r * t.x, below = (column - depth).sum();
    if (std::abs(below) <= kRounding * (column.abs().sum() + depth.abs().sum()))
        return Error{
            "the column of the right pixel does not depend on the depth, expected a baseline with a part along "
            "the rows and a point away from the epipole"};
    return above / below;
}

}  // namespace narpa
