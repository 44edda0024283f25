#include "renderer/projection/kannala_brandt.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/each_isa.h"
#include "base/fast_math.h"
#include "base/lanes.h"

namespace narpa {

// Inline, because the compiler does not inline functions that another library may replace, and loops with calls are
// not vectorised.
inline double KannalaBrandt::radius(double theta) const noexcept {
    const double s = theta * theta;
    return theta * (1 + s * (c_.k1 + s * (c_.k2 + s * (c_.k3 + s * c_.k4))));
}
inline double KannalaBrandt::slope(double theta) const noexcept {
    const double s = theta * theta;
    return 1 + s * (3 * c_.k1 + s * (5 * c_.k2 + s * (7 * c_.k3 + s * 9 * c_.k4)));
}

namespace {

/// Just below 180 degrees, where a whole circle would be one direction.
constexpr double kMaxAngle_rad = 3.14;
/// The table's start is off by at most 1e-5, except in the last entries before a rim where the slope ends.
constexpr int kAngleSteps = 4;

inline double newton_step(const KannalaBrandt& m, double distorted, double theta) noexcept {
    return theta - (m.radius(theta) - distorted) / m.slope(theta);
}

/// Direction for the result `theta` of the search from `begin`; if that has no solution, a direction on or near the
/// rim.
inline Vec3 direction_at(const KannalaBrandt& m, const RadialInverse& inverse, const Vec3& wanted, double distorted,
                         double begin, double theta) noexcept {
    const bool converged = std::abs(m.radius(theta) - distorted) < 1e-10;
    const double last = theta <= inverse.most() * (1 + 1e-12) ? theta : begin;
    const SinCos at = sincos_of_turns((converged ? last : begin) * (0.5 / std::numbers::pi));
    const double side = at.sin / std::max(distorted, std::numeric_limits<double>::min());
    return {side * wanted.x, side * wanted.y, at.cos};
}

inline double length_of(const Vec3& wanted) noexcept {
    return std::sqrt(wanted.x * wanted.x + wanted.y * wanted.y);
}

inline Vec3 direction_of(const KannalaBrandt& m, const RadialInverse& inverse, const Vec3& wanted) noexcept {
    const double distorted = length_of(wanted), begin = distorted * inverse.ratio(distorted);
    double theta = begin;
    for (int k = 0; k < kAngleSteps; ++k) theta = newton_step(m, distorted, theta);
    return direction_at(m, inverse, wanted, distorted, begin, theta);
}

NARPA_EACH_ISA void directions_of(const KannalaBrandt& m, const Pinhole& pinhole, const RadialInverse& inverse,
                                  const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                                  Vec3Lanes& out) noexcept {
    Lanes<double> distorted, begin, theta;
    for (std::size_t i = 0; i < kLanes; ++i) {
        distorted[i] = length_of(pinhole.on_plane({x[i], y[i]}));
        theta[i] = begin[i] = distorted[i] * inverse.ratio(distorted[i]);
    }
    for (int k = 0; k < kAngleSteps; ++k)
        for (std::size_t i = 0; i < kLanes; ++i) theta[i] = newton_step(m, distorted[i], theta[i]);
    Vec3Lanes direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 d =
            q * direction_at(m, inverse, pinhole.on_plane({x[i], y[i]}), distorted[i], begin[i], theta[i]);
        direction.x[i] = d.x, direction.y[i] = d.y, direction.z[i] = d.z;
    }
    out = direction;
}

}  // namespace

namespace {

constexpr std::array<TableKey, 1> kKannalaBrandtKeys{{{"coefficients", rows::numbers({4}), kCoefficients}}};
constexpr std::array<RosName, 2> kKannalaBrandtRosNames{{{"equidistant", 4}, {"fisheye", 4}}};

}  // namespace

constinit const ProjectionKind kKannalaBrandt{.name = "kannala_brandt",
                                              .opencv = "fisheye",
                                              .ros = kKannalaBrandtRosNames,
                                              .keys = kKannalaBrandtKeys,
                                              .fov_max_deg = 360,
                                              .make = make_model<KannalaBrandt>};

KannalaBrandt::KannalaBrandt(const Pinhole& pinhole, std::span<const double> k)
    : CalibratedModel(kKannalaBrandt, pinhole, k),
      c_{k[0], k[1], k[2], k[3]},
      inverse_(
          kMaxAngle_rad, [&](double t) { return radius(t); }, [&](double t) { return slope(t); }) {}

Vec3 KannalaBrandt::direction(const ImagePoint& p) const noexcept {
    return direction_of(*this, inverse_, pinhole_.on_plane(p));
}

void KannalaBrandt::directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                               Vec3Lanes& out) const noexcept {
    directions_of(*this, pinhole_, inverse_, q, x, y, out);
}

std::optional<ImagePoint> KannalaBrandt::project(const Vec3& p) const noexcept {
    const double side = std::hypot(p.x, p.y), theta = std::atan2(side, p.z);
    if (!(theta <= inverse_.most()) || !(side > 0 || p.z > 0)) return std::nullopt;
    const double k = side > 0 ? radius(theta) / side : 1 / p.z;
    return pinhole_.of_plane(k * p.x, k * p.y);
}

ProjectionJacobian KannalaBrandt::jacobian(const Vec3& p) const noexcept {
    const double fx = pinhole_.fx, fy = pinhole_.fy, side = std::hypot(p.x, p.y), square = dot(p, p);
    if (side < 1e-9 * p.z) return {{fx / p.z, 0, 0}, {0, fy / p.z, 0}};
    // theta' (X, Y) / side, with d theta = (Z X, Z Y, -side^2) / (side square).
    const double theta = std::atan2(side, p.z), g = slope(theta), k = radius(theta) / side;
    const double c = p.x / side, s = p.y / side, along = g * p.z / square;
    return {fx * Vec3{along * c * c + k * s * s, (along - k) * c * s, -g * side * c / square},
            fy * Vec3{(along - k) * c * s, along * s * s + k * c * c, -g * side * s / square}};
}

bool KannalaBrandt::sees(const ImagePoint& p) const noexcept {
    const Vec3 wanted = pinhole_.on_plane(p);
    return std::hypot(wanted.x, wanted.y) <= inverse_.max_distorted();
}

bool KannalaBrandt::is_valid() const noexcept {
    return CalibratedModel::is_valid() && inverse_.most() > 0;
}

}  // namespace narpa
