/// renderer/projection/brown_conrady.h - a pinhole with lens distortion, as OpenCV's calib3d defines it.
///
/// For a point (X, Y, Z), Z > 0, in camera axes: u = X / Z, v = Y / Z, r^2 = u^2 + v^2,
///
///     L  = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
///     u' = u L + 2 p1 u v + p2 (r^2 + 2 u^2) + s1 r^2 + s2 r^4
///     v' = v L + p1 (r^2 + 2 v^2) + 2 p2 u v + s3 r^2 + s4 r^4
///     x  = cx + fx u',  y = cy + fy v'.
///
/// Sources: D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37 (1971), radial and
/// tangential terms; J. Weng et al., "Camera calibration with distortion models and accuracy evaluation", IEEE PAMI
/// 14 (1992), thin prism; OpenCV's documentation for the order and the rational form.
#pragma once

#include "renderer/projection/calibrated_model.h"
#include "renderer/projection/radial_inverse.h"

namespace narpa {

/// The coefficients alone: (u, v) to (u', v') and its derivatives.
struct BrownDistortion {
    double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0, s1 = 0, s2 = 0, s3 = 0, s4 = 0;

    /// The distorted image of a point of the plane z = 1, and its derivatives: u_by_v is du'/dv.
    struct Distorted {
        double u, v, u_by_u, u_by_v, v_by_u, v_by_v;
    };
    // Inline, because the compiler does not inline functions that another library may replace, and loops with calls
    // are not vectorised.
    [[nodiscard]] Distorted at(double u, double v) const noexcept {
        const double s = u * u + v * v, uv = u * v;
        const double above = 1 + s * (k1 + s * (k2 + s * k3)), below = 1 + s * (k4 + s * (k5 + s * k6));
        const double L = above / below;
        const double L_by_s = (k1 + s * (2 * k2 + s * 3 * k3) - L * (k4 + s * (2 * k5 + s * 3 * k6))) / below;
        const double prism_u = 2 * (s1 + 2 * s2 * s), prism_v = 2 * (s3 + 2 * s4 * s);  // by s, doubled
        const double cross = 2 * (uv * L_by_s + p1 * u + p2 * v);
        return {u * L + 2 * p1 * uv + p2 * (s + 2 * u * u) + s * (s1 + s * s2),
                v * L + p1 * (s + 2 * v * v) + 2 * p2 * uv + s * (s3 + s * s4),
                L + 2 * u * u * L_by_s + 2 * p1 * v + 6 * p2 * u + prism_u * u,
                cross + prism_u * v,
                cross + prism_v * u,
                L + 2 * v * v * L_by_s + 6 * p1 * v + 2 * p2 * u + prism_v * v};
    }
    /// In OpenCV's order; those that are missing are 0.
    [[nodiscard]] static BrownDistortion of(std::span<const double> coefficients) noexcept;
};

/// The image ends where r L no longer grows with r, because it would fold over beyond.
class BrownConrady final : public CalibratedModel {
public:
    /// k1, k2, p1, p2 [, k3 [, k4, k5, k6 [, s1, s2, s3, s4]]]: 4, 5, 8 or 12 coefficients.
    BrownConrady(const Pinhole& pinhole, std::span<const double> coefficients);

    /// By Newton's method: exact to rounding where `sees` is true, the direction of the rim beyond.
    [[nodiscard]] Vec3 direction(const ImagePoint& p) const noexcept override { return normalized(on_plane(p)); }
    [[nodiscard]] Vec3 on_plane(const ImagePoint& p) const noexcept override;
    void directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                    Vec3Lanes& out) const noexcept override;
    [[nodiscard]] std::optional<ImagePoint> project(const Vec3& point) const noexcept override;
    [[nodiscard]] ProjectionJacobian jacobian(const Vec3& point) const noexcept override;
    [[nodiscard]] bool sees(const ImagePoint& p) const noexcept override;
    [[nodiscard]] bool is_valid() const noexcept override;

    using Distorted = BrownDistortion::Distorted;
    [[nodiscard]] Distorted distort(double u, double v) const noexcept { return c_.at(u, v); }

private:
    [[nodiscard]] double radius(double r) const noexcept;
    [[nodiscard]] double slope(double r) const noexcept;

    BrownDistortion c_;
    RadialInverse inverse_;
};

extern const ProjectionKind kBrownConrady;

}  // namespace narpa
