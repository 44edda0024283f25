/// renderer/projection/double_sphere.h - the double-sphere model of fisheye lenses.
///
/// For a point p = (X, Y, Z) in camera axes: d1 = |p|, Z' = xi d1 + Z, d2 = |(X, Y, Z')|, and
///
///     x = cx + fx X / (alpha d2 + (1 - alpha) Z'),   y likewise.
///
/// The point is projected onto a unit sphere, from there onto a second one whose centre is shifted by xi, and from
/// there by a pinhole whose centre is shifted by alpha / (1 - alpha). Both directions are closed forms. Source:
/// V. Usenko, N. Demmel and D. Cremers, "The Double Sphere Camera Model", 3DV 2018, equations 40 to 50. Kalibr and
/// Basalt call it "ds".
#pragma once

#include "renderer/projection/calibrated_model.h"

namespace narpa {

/// The image ends where its radius no longer grows with the angle from the axis: cos(angle) = -cos_max(). The
/// paper's limit w2 (equation 43) equals it for xi = 0 and lies within it otherwise; its inverse (equation 46)
/// reaches this one.
class DoubleSphere final : public CalibratedModel {
public:
    /// xi in (-1, 1), alpha in [0, 1].
    DoubleSphere(const Pinhole& pinhole, std::span<const double> xi_alpha);

    /// Exact to rounding where `sees` is true, the direction of the rim beyond.
    [[nodiscard]] Vec3 direction(const ImagePoint& p) const noexcept override;
    void directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                    Vec3Lanes& out) const noexcept override;
    [[nodiscard]] std::optional<ImagePoint> project(const Vec3& point) const noexcept override;
    [[nodiscard]] ProjectionJacobian jacobian(const Vec3& point) const noexcept override;
    [[nodiscard]] bool sees(const ImagePoint& p) const noexcept override;
    [[nodiscard]] double pixels_per_radian() const noexcept override { return pinhole_.fx / (1 + xi_); }
    [[nodiscard]] bool is_valid() const noexcept override;

    /// Cosine of the largest angle from the axis that has an image.
    [[nodiscard]] double cos_min() const noexcept { return cos_min_; }

private:
    double xi_, alpha_;
    double cos_min_;
    double radius2_max_;  ///< of (x - cx) / fx, (y - cy) / fy; infinite for alpha <= 1/2
};

extern const ProjectionKind kDoubleSphere;

}  // namespace narpa
