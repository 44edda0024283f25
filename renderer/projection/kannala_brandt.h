/// renderer/projection/kannala_brandt.h - a fisheye lens, as OpenCV's fisheye module defines it.
///
/// For a point (X, Y, Z) in camera axes, at the angle theta from the z axis:
///
///     theta' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
///     (x, y) = (cx, cy) + theta' (fx X, fy Y) / hypot(X, Y).
///
/// OpenCV itself stops at 90 degrees; here theta may be larger, as the formula allows. Source: J. Kannala and
/// S. Brandt, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye lenses",
/// IEEE PAMI 28 (2006).
#pragma once

#include "renderer/projection/calibrated_model.h"
#include "renderer/projection/radial_inverse.h"

namespace narpa {

/// The image ends where theta' no longer grows with theta, and at 180 degrees.
class KannalaBrandt final : public CalibratedModel {
public:
    /// k1, k2, k3, k4.
    KannalaBrandt(const Pinhole& pinhole, std::span<const double> coefficients);

    /// By Newton's method: exact to rounding where `sees` is true, the direction of the rim beyond.
    [[nodiscard]] Vec3 direction(const ImagePoint& p) const noexcept override;
    void directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                    Vec3Lanes& out) const noexcept override;
    [[nodiscard]] std::optional<ImagePoint> project(const Vec3& point) const noexcept override;
    [[nodiscard]] ProjectionJacobian jacobian(const Vec3& point) const noexcept override;
    [[nodiscard]] bool sees(const ImagePoint& p) const noexcept override;
    [[nodiscard]] bool is_valid() const noexcept override;

    /// theta' and its derivative.
    [[nodiscard]] double radius(double theta) const noexcept;
    [[nodiscard]] double slope(double theta) const noexcept;

private:
    struct Coefficients {
        double k1, k2, k3, k4;
    } c_;
    RadialInverse inverse_;
};

extern const ProjectionKind kKannalaBrandt;

}  // namespace narpa
