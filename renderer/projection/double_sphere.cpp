#include "renderer/projection/double_sphere.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr std::array<TableKey, 2> kDoubleSphereKeys{{
    {"xi", rows::number({.low = -1, .high = 1, .low_open = true, .high_open = true}), "a number in (-1, 1)"},
    {"alpha", rows::number({.low = 0, .high = 1}), "a number in [0, 1]"},
}};

/// Unit direction whose image is (m.x, m.y) for fx = fy = 1 and a principal point of 0; beyond the rim, that of the
/// rim.
inline Vec3 unprojected(double xi, double alpha, double radius2_max, const Vec3& m) noexcept {
    const double wanted2 = m.x * m.x + m.y * m.y, r2 = std::min(wanted2, radius2_max);
    const double shrink = wanted2 > radius2_max ? std::sqrt(radius2_max / wanted2) : 1;
    constexpr double kTiny = std::numeric_limits<double>::min();  // 0 / 0 is 0: the rim for alpha = 1
    const double z = (1 - alpha * alpha * r2) /
                     (alpha * std::sqrt(std::max(1 - (2 * alpha - 1) * r2, 0.0)) + (1 - alpha) + kTiny);
    const double k = (z * xi + std::sqrt(z * z + (1 - xi * xi) * r2)) / (z * z + r2);
    return {k * shrink * m.x, k * shrink * m.y, k * z - xi};
}

NARPA_EACH_ISA void directions_of(const Pinhole& pinhole, double xi, double alpha, double radius2_max,
                                  const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                                  Vec3Lanes& out) noexcept {
    Vec3Lanes direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 d = q * unprojected(xi, alpha, radius2_max, pinhole.on_plane({x[i], y[i]}));
        direction.x[i] = d.x, direction.y[i] = d.y, direction.z[i] = d.z;
    }
    out = direction;
}

/// Cosine of the angle from the axis at which the image ends. On the second sphere it ends at the cosine -w: where
/// alpha is at most 1/2, the denominator is 0 there; where it is larger, the radius has its maximum.
double cos_at_rim(double xi, double alpha) noexcept {
    const double w = alpha <= 0.5 ? alpha / (1 - alpha) : (1 - alpha) / alpha;
    return -xi * (1 - w * w) - w * std::sqrt(1 - xi * xi * (1 - w * w));
}

}  // namespace

constinit const ProjectionKind kDoubleSphere{
    .name = "double_sphere", .keys = kDoubleSphereKeys, .fov_max_deg = 360, .make = make_model<DoubleSphere>};

DoubleSphere::DoubleSphere(const Pinhole& pinhole, std::span<const double> xi_alpha)
    : CalibratedModel(kDoubleSphere, pinhole, xi_alpha),
      xi_(xi_alpha[0]),
      alpha_(xi_alpha[1]),
      cos_min_(cos_at_rim(xi_, alpha_)),
      radius2_max_(alpha_ > 0.5 ? 1 / (2 * alpha_ - 1) : std::numeric_limits<double>::infinity()) {}

Vec3 DoubleSphere::direction(const ImagePoint& p) const noexcept {
    return unprojected(xi_, alpha_, radius2_max_, pinhole_.on_plane(p));
}

void DoubleSphere::directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                              Vec3Lanes& out) const noexcept {
    directions_of(pinhole_, xi_, alpha_, radius2_max_, q, x, y, out);
}

std::optional<ImagePoint> DoubleSphere::project(const Vec3& p) const noexcept {
    const double d1 = norm(p);
    if (!(p.z > cos_min_ * d1)) return std::nullopt;
    const double z = xi_ * d1 + p.z, below = alpha_ * std::hypot(p.x, p.y, z) + (1 - alpha_) * z;
    return pinhole_.of_plane(p.x / below, p.y / below);
}

ProjectionJacobian DoubleSphere::jacobian(const Vec3& p) const noexcept {
    const double d1 = norm(p), z = xi_ * d1 + p.z, d2 = std::hypot(p.x, p.y, z);
    const double below = alpha_ * d2 + (1 - alpha_) * z;
    const Vec3 z_by_p = xi_ / d1 * p + Vec3{0, 0, 1};
    const Vec3 below_by_p = alpha_ / d2 * (Vec3{p.x, p.y, 0} + z * z_by_p) + (1 - alpha_) * z_by_p;
    return {pinhole_.fx / below * (Vec3{1, 0, 0} - p.x / below * below_by_p),
            pinhole_.fy / below * (Vec3{0, 1, 0} - p.y / below * below_by_p)};
}

bool DoubleSphere::sees(const ImagePoint& p) const noexcept {
    const Vec3 m = pinhole_.on_plane(p);
    return m.x * m.x + m.y * m.y <= radius2_max_;
}

bool DoubleSphere::is_valid() const noexcept {
    return CalibratedModel::is_valid() && xi_ > -1 && xi_ < 1 && alpha_ >= 0 && alpha_ <= 1;
}

}  // namespace narpa
