#include "estimator/batch/camera_change.h"

#include <algorithm>

#include "estimator/pnp/pnp_points.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/projection/projection_kind.h"

namespace narpa {
namespace {

/// In the order of OpenCV's coefficients.
constexpr std::array kDistortion{BatchUnknown::k1, BatchUnknown::k2, BatchUnknown::p1, BatchUnknown::p2,
                                 BatchUnknown::k3};

bool is_of_opencv(const ProjectionParameters& p) {
    return p.kind == &kPinhole || p.kind == &kBrownConrady;
}

}  // namespace

ChangedCamera::ChangedCamera(const CameraModel& model, const BatchValues& change) : base_(&model) {
    if (const ProjectionParameters p = model.parameters(); is_of_opencv(p)) {
        base_ = nullptr, pinhole_ = p.pinhole;
        distortion_ = BrownDistortion::of(p.values);
    }
    distortion_.k1 += at(change, BatchUnknown::k1), distortion_.k2 += at(change, BatchUnknown::k2);
    distortion_.p1 += at(change, BatchUnknown::p1), distortion_.p2 += at(change, BatchUnknown::p2);
    distortion_.k3 += at(change, BatchUnknown::k3);
    const auto centre = (base_ ? *base_ : pinhole_).project({0, 0, 1});
    centre_ = centre ? Eigen::Vector2d(centre->x, centre->y) : Eigen::Vector2d::Zero();
    const double focal = 1 + at(change, BatchUnknown::focal);
    stretch_by_focal_ = 1 + at(change, BatchUnknown::aspect);
    stretch_ = {focal, focal * stretch_by_focal_};
    shift_ = {at(change, BatchUnknown::centre_x), at(change, BatchUnknown::centre_y)};
}

bool ChangedCamera::project(const Vec3& p, ChangedImage& out) const {
    if (!(p.z > 0)) return false;
    const double u = p.x / p.z, v = p.y / p.z, s = u * u + v * v;
    const BrownDistortion::Distorted d = distortion_.at(u, v);
    Eigen::Matrix2d bent_by_plane;
    bent_by_plane << d.u_by_u, d.u_by_v, d.v_by_u, d.v_by_v;
    // Beyond, the image folds over.
    if (!(bent_by_plane.determinant() > 0 && bent_by_plane.trace() > 0)) return false;
    const Vec3 bent{d.u, d.v, 1};
    const CameraModel& base = base_ ? *base_ : pinhole_;
    const auto image = base.project(bent);
    if (!image) return false;
    const Eigen::Matrix2d by_bent = stretch_.asDiagonal() * to_eigen(base.jacobian(bent)).leftCols<2>();
    Eigen::Matrix<double, 2, 3> plane_by_point;
    plane_by_point << 1 / p.z, 0, -u / p.z, 0, 1 / p.z, -v / p.z;
    const Eigen::Vector2d from_centre = Eigen::Vector2d(image->x, image->y) - centre_;
    out.pixel = centre_ + stretch_.cwiseProduct(from_centre) + shift_;
    out.by_point = by_bent * bent_by_plane * plane_by_point;
    const double below = 1 + s * (distortion_.k4 + s * (distortion_.k5 + s * distortion_.k6));
    const Eigen::Vector2d radial = s / below * Eigen::Vector2d(u, v);
    out.by_camera.col(0) << from_centre.x(), stretch_by_focal_ * from_centre.y();
    out.by_camera.col(1) << 0, stretch_.x() * from_centre.y();
    out.by_camera.middleCols<2>(2).setIdentity();
    out.by_camera.col(4) = by_bent * radial;
    out.by_camera.col(5) = by_bent * (s * radial);
    out.by_camera.col(6) = by_bent * Eigen::Vector2d(2 * u * v, s + 2 * v * v);
    out.by_camera.col(7) = by_bent * Eigen::Vector2d(s + 2 * u * u, 2 * u * v);
    out.by_camera.col(8) = by_bent * (s * s * radial);
    return true;
}

Result<std::shared_ptr<const CameraModel>> changed_camera(const CameraModel& model, const BatchValues& change) {
    ProjectionParameters p = model.parameters();
    if (!p.kind) return Error{"a projection without parameters that could be wrong"};
    std::size_t coefficients = 0;  // that change
    for (std::size_t i = 0; i < kDistortion.size(); ++i)
        if (at(change, kDistortion[i]) != 0) coefficients = i + 1;
    if (coefficients > 0) {
        if (!is_of_opencv(p))
            return Error{"k1, k2, p1, p2 and k3 are of cameras without distortion or with that of OpenCV"};
        p.kind = &kBrownConrady;
        p.values.resize(std::max<std::size_t>({p.values.size(), coefficients, 4}));
        for (std::size_t i = 0; i < coefficients; ++i) p.values[i] += at(change, kDistortion[i]);
    }
    const double focal = 1 + at(change, BatchUnknown::focal);
    p.pinhole.fx *= focal, p.pinhole.fy *= focal * (1 + at(change, BatchUnknown::aspect));
    p.pinhole.cx += at(change, BatchUnknown::centre_x), p.pinhole.cy += at(change, BatchUnknown::centre_y);
    std::shared_ptr<const CameraModel> changed = make_projection(p);
    if (!changed || !changed->is_valid()) return Error{"no projection has these parameters"};
    return changed;
}

}  // namespace narpa
