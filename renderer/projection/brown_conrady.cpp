#include "renderer/projection/brown_conrady.h"

#include <array>
#include <cmath>

#include "base/each_isa.h"
#include "base/lanes.h"

namespace narpa {

namespace {

using Model = BrownConrady;

/// Largest tan(angle from the axis): 89 degrees.
constexpr double kMaxPlane = 57.3;
/// The table's start is off by at most 1e-3 with strong tangential terms; each step squares the error.
constexpr int kNewtonSteps = 5;
/// Largest residual of a solution, in units of the plane z = 1.
constexpr double kResidual = 1e-10;

struct PlanePoint {
    double u, v;
};

inline PlanePoint newton_step(const Model& m, const PlanePoint& wanted, const PlanePoint& p) noexcept {
    const Model::Distorted d = m.distort(p.u, p.v);
    const double du = d.u - wanted.u, dv = d.v - wanted.v, det = d.u_by_u * d.v_by_v - d.u_by_v * d.v_by_u;
    return {p.u - (du * d.v_by_v - dv * d.u_by_v) / det, p.v - (dv * d.u_by_u - du * d.v_by_u) / det};
}

inline bool is_solution(const Model& m, const RadialInverse& inverse, const PlanePoint& wanted,
                        const PlanePoint& p) noexcept {
    const Model::Distorted d = m.distort(p.u, p.v);
    const double most = inverse.most() * (1 + 1e-12);
    return std::abs(d.u - wanted.u) + std::abs(d.v - wanted.v) < kResidual && p.u * p.u + p.v * p.v <= most * most;
}

inline PlanePoint start(const RadialInverse& inverse, const PlanePoint& wanted) noexcept {
    const double ratio = inverse.ratio(std::sqrt(wanted.u * wanted.u + wanted.v * wanted.v));
    return {ratio * wanted.u, ratio * wanted.v};
}

/// The point of the plane z = 1 whose distorted image is `wanted`; if there is none, the start of the search, on or
/// near the rim.
inline PlanePoint undistort(const Model& m, const RadialInverse& inverse, const PlanePoint& wanted) noexcept {
    const PlanePoint begin = start(inverse, wanted);
    PlanePoint p = begin;
    for (int i = 0; i < kNewtonSteps; ++i) p = newton_step(m, wanted, p);
    return is_solution(m, inverse, wanted, p) ? p : begin;
}

NARPA_EACH_ISA void directions_of(const Model& m, const Pinhole& pinhole, const RadialInverse& inverse,
                                  const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                                  Vec3Lanes& out) noexcept {
    Lanes<double> wanted_u, wanted_v, begin_u, begin_v, u, v;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 wanted = pinhole.on_plane({x[i], y[i]});
        wanted_u[i] = wanted.x, wanted_v[i] = wanted.y;
        const PlanePoint p = start(inverse, {wanted_u[i], wanted_v[i]});
        u[i] = begin_u[i] = p.u, v[i] = begin_v[i] = p.v;
    }
    for (int k = 0; k < kNewtonSteps; ++k)
        for (std::size_t i = 0; i < kLanes; ++i) {
            const PlanePoint p = newton_step(m, {wanted_u[i], wanted_v[i]}, {u[i], v[i]});
            u[i] = p.u, v[i] = p.v;
        }
    Vec3Lanes direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool found = is_solution(m, inverse, {wanted_u[i], wanted_v[i]}, {u[i], v[i]});
        const Vec3 d = q * normalized(Vec3{found ? u[i] : begin_u[i], found ? v[i] : begin_v[i], 1});
        direction.x[i] = d.x, direction.y[i] = d.y, direction.z[i] = d.z;
    }
    out = direction;
}

}  // namespace

namespace {

constexpr std::array<TableKey, 1> kBrownConradyKeys{
    {{"coefficients", rows::numbers({4, 5, 8, 12}), kCoefficients}}};
constexpr std::array<RosName, 2> kBrownConradyRosNames{{{"plumb_bob", 5}, {"rational_polynomial", 12}}};

}  // namespace

constinit const ProjectionKind kBrownConrady{.name = "brown_conrady",
                                             .opencv = "opencv",
                                             .ros = kBrownConradyRosNames,
                                             .keys = kBrownConradyKeys,
                                             .make = make_model<BrownConrady>};

BrownDistortion BrownDistortion::of(std::span<const double> coefficients) noexcept {
    const auto at = [&](std::size_t i) { return i < coefficients.size() ? coefficients[i] : 0; };
    return {at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7), at(8), at(9), at(10), at(11)};
}

BrownConrady::BrownConrady(const Pinhole& pinhole, std::span<const double> coefficients)
    : CalibratedModel(kBrownConrady, pinhole, coefficients),
      c_(BrownDistortion::of(coefficients)),
      inverse_(
          kMaxPlane, [&](double r) { return radius(r); }, [&](double r) { return slope(r); }) {}

double BrownConrady::radius(double r) const noexcept {
    const double s = r * r;
    return r * (1 + s * (c_.k1 + s * (c_.k2 + s * c_.k3))) / (1 + s * (c_.k4 + s * (c_.k5 + s * c_.k6)));
}

/// Derivative of `radius`; 0 at and beyond the first pole.
double BrownConrady::slope(double r) const noexcept {
    const double s = r * r;
    const double above = 1 + s * (c_.k1 + s * (c_.k2 + s * c_.k3)),
                 below = 1 + s * (c_.k4 + s * (c_.k5 + s * c_.k6));
    if (!(below > 0)) return 0;
    const double above_by_s = c_.k1 + s * (2 * c_.k2 + s * 3 * c_.k3),
                 below_by_s = c_.k4 + s * (2 * c_.k5 + s * 3 * c_.k6);
    return above / below + 2 * s * (above_by_s * below - above * below_by_s) / (below * below);
}

Vec3 BrownConrady::on_plane(const ImagePoint& p) const noexcept {
    const Vec3 wanted = pinhole_.on_plane(p);
    const auto [u, v] = undistort(*this, inverse_, {wanted.x, wanted.y});
    return {u, v, 1};
}

void BrownConrady::directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                              Vec3Lanes& out) const noexcept {
    directions_of(*this, pinhole_, inverse_, q, x, y, out);
}

std::optional<ImagePoint> BrownConrady::project(const Vec3& p) const noexcept {
    if (!(p.z > 0)) return std::nullopt;
    const double u = p.x / p.z, v = p.y / p.z;
    if (!(std::hypot(u, v) <= inverse_.most())) return std::nullopt;
    const Distorted d = distort(u, v);
    if (!(std::hypot(d.u, d.v) <= inverse_.max_distorted())) return std::nullopt;
    return pinhole_.of_plane(d.u, d.v);
}

ProjectionJacobian BrownConrady::jacobian(const Vec3& p) const noexcept {
    const double u = p.x / p.z, v = p.y / p.z;
    const Distorted d = distort(u, v);
    const auto gradient = [&](double by_u, double by_v) { return Vec3{by_u, by_v, -u * by_u - v * by_v} / p.z; };
    return {pinhole_.fx * gradient(d.u_by_u, d.u_by_v), pinhole_.fy * gradient(d.v_by_u, d.v_by_v)};
}

bool BrownConrady::sees(const ImagePoint& p) const noexcept {
    const Vec3 wanted = pinhole_.on_plane(p);
    if (!(std::hypot(wanted.x, wanted.y) <= inverse_.max_distorted())) return false;
    const auto [u, v] = undistort(*this, inverse_, {wanted.x, wanted.y});
    return is_solution(*this, inverse_, {wanted.x, wanted.y}, {u, v});
}

bool BrownConrady::is_valid() const noexcept {
    return CalibratedModel::is_valid() && inverse_.most() > 0;
}

}  // namespace narpa
