#include "estimator/pnp/pnp_points.h"

#include <cassert>
#include <cmath>
#include <limits>

#include "base/each_isa.h"

namespace narpa {

const char* to_text(PnpStatus status) {
    switch (status) {
        case PnpStatus::converged: return "converged";
        case PnpStatus::no_convergence: return "the refinement did not settle within its iterations";
        case PnpStatus::degenerate:
            return "the points leave a direction of the pose undetermined (all on one line, or coinciding)";
        case PnpStatus::behind_camera: return "a point lies behind the camera, expected all in front of it";
        case PnpStatus::too_few_points: return "fewer points than the 3 that a pose needs (4 without a guess)";
        case PnpStatus::too_many_points: return "more points than the solver was made for";
        case PnpStatus::sizes_differ:
            return "points, pixels and covariances differ in number, expected one of each";
        case PnpStatus::not_finite: return "a point, a pixel or the pose to start from is not finite";
        case PnpStatus::bad_camera: return "the camera's focal lengths must be above 0 and all its numbers finite";
        case PnpStatus::bad_noise: return "sigma must be above 0, and every covariance positive definite";
        case PnpStatus::no_consensus: return "no pose agrees with enough of the points";
    }
    return "unknown";
}

PnpStatus check(const PnpInput& input) {
    if (!input.camera || !input.camera->is_valid()) return PnpStatus::bad_camera;
    if (input.body_m.size() != input.pixels.size()) return PnpStatus::sizes_differ;
    if (!input.covariance_px2.empty() && input.covariance_px2.size() != input.pixels.size())
        return PnpStatus::sizes_differ;
    if (input.body_m.size() < 3) return PnpStatus::too_few_points;
    for (const Vec3& p : input.body_m)
        if (!is_finite(p)) return PnpStatus::not_finite;
    for (const Pixel& p : input.pixels)
        if (!std::isfinite(p.u) || !std::isfinite(p.v)) return PnpStatus::not_finite;
    if (input.camera->pinhole() == nullptr)
        for (const Pixel& p : input.pixels)
            if (!(input.camera->direction({p.u, p.v}).z > 0)) return PnpStatus::behind_camera;
    if (!(input.sigma_px > 0) || !std::isfinite(input.sigma_px)) return PnpStatus::bad_noise;
    for (const PixelCovariance& s : input.covariance_px2)
        if (!(s.uu > 0 && s.uu * s.vv > s.uv * s.uv) || !std::isfinite(s.uu * s.vv)) return PnpStatus::bad_noise;
    return PnpStatus::converged;
}

namespace {

/// Formulas of a pinhole are inlined; other models use virtual calls.
template <class F>
void with_model(const CameraModel& model, const F& f) {
    if (const Pinhole* pinhole = model.pinhole())
        f(*pinhole);
    else
        f(model);
}

}  // namespace

PnpPoints::PnpPoints(std::size_t points_max) : groups_((points_max + kGroup - 1) / kGroup) {}

template <class Chosen>
void PnpPoints::assign_if(const PnpInput& input, const Chosen& chosen) {
    assert(input.body_m.size() == input.pixels.size());
    assert(input.covariance_px2.empty() || input.covariance_px2.size() == input.pixels.size());
    size_ = 0;
    rounding_ = 0;
    Vec3 sum{};
    for (std::size_t i = 0; i < input.body_m.size(); ++i)
        if (chosen(i)) sum += input.body_m[i], ++size_;
    assert(size_ > 0 && size_ <= capacity());
    centroid_ = sum / static_cast<double>(size_);
    with_model(*input.camera, [&](const auto& model) {
        for (std::size_t i = 0, to = 0; i < input.body_m.size(); ++i)
            if (chosen(i)) put(to++, input, model, i);
    });
    pad();
}

void PnpPoints::assign(const PnpInput& input) {
    assign_if(input, [](std::size_t) { return true; });
}

void PnpPoints::assign(const PnpInput& input, std::span<const std::uint8_t> chosen) {
    assign_if(input, [&](std::size_t i) { return chosen[i] != 0; });
}

/// Residuals are formed on the plane z = 1 and weighted like those of the image, to first order about the measured
/// pixel: exact for a pinhole.
template <class Model>
void PnpPoints::put(std::size_t i, const PnpInput& input, const Model& model, std::size_t point) {
    const Vec3 a = input.body_m[point] - centroid_;
    const Vec3 on_plane = model.on_plane({input.pixels[point].u, input.pixels[point].v});
    const ProjectionJacobian J = model.jacobian(on_plane);
    Group& to = groups_[i / kGroup];
    const std::size_t k = i % kGroup;
    to.x[k] = a.x, to.y[k] = a.y, to.z[k] = a.z;
    to.u[k] = on_plane.x, to.v[k] = on_plane.y;
    // C^-1 = W' W with W upper triangular: 1 / sqrt(var(v)) last, and u conditioned on v.
    double w00 = 1 / input.sigma_px, w01 = 0, w11 = w00;
    if (!input.covariance_px2.empty()) {
        const PixelCovariance& s = input.covariance_px2[point];
        w00 = 1 / std::sqrt(s.uu - s.uv * s.uv / s.vv), w01 = -w00 * s.uv / s.vv, w11 = 1 / std::sqrt(s.vv);
    }
    // W J, made upper triangular again by a rotation of its rows.
    const double a00 = w00 * J.x.x + w01 * J.y.x, a01 = w00 * J.x.y + w01 * J.y.y;
    const double a10 = w11 * J.y.x, a11 = w11 * J.y.y;
    if (a10 == 0) {
        to.l00[k] = a00, to.l10[k] = a01, to.l11[k] = a11;
    } else {
        const double r = std::hypot(a00, a10), c = a00 / r, s = a10 / r;
        to.l00[k] = r, to.l10[k] = c * a01 + s * a11, to.l11[k] = c * a11 - s * a01;
    }
    // Rounding error of a residual: the last digits of the numbers whose difference it is.
    constexpr double kDigits = 4 * std::numeric_limits<double>::epsilon();
    const double size2 = 1 + on_plane.x * on_plane.x + on_plane.y * on_plane.y;
    rounding_ +=
        kDigits * kDigits * size2 * (to.l00[k] * to.l00[k] + to.l10[k] * to.l10[k] + to.l11[k] * to.l11[k]);
}

void PnpPoints::pad() {
    for (std::size_t i = size_; i % kGroup != 0; ++i) {
        Group& g = groups_[i / kGroup];
        const std::size_t k = i % kGroup;
        // Pads with the first point at zero weight: it is in front of the camera whenever the points are.
        g.x[k] = g.x[0], g.y[k] = g.y[0], g.z[k] = g.z[0], g.u[k] = g.u[0], g.v[k] = g.v[0];
        g.l00[k] = g.l10[k] = g.l11[k] = 0;
    }
}

CentredPose PnpPoints::centred(const Rigid3& T_camera_body) const {
    return {T_camera_body.q, T_camera_body * centroid_};
}

Rigid3 PnpPoints::uncentred(const CentredPose& pose) const {
    return {pose.q, pose.centroid_m - pose.q * centroid_};
}

Matrix6 PnpPoints::uncentred(const CentredPose& pose, const Matrix6& covariance) const {
    // t = centroid - q c  =>  d_t = d_centroid + [q c] r
    Matrix6 J = Matrix6::Identity();
    J.bottomLeftCorner<3, 3>() = skew(to_eigen(pose.q * centroid_));
    return J * covariance * J.transpose();
}

namespace {

// Eight numbers side by side. The types stay inside the function that is compiled for each processor.
using V = double __attribute__((vector_size(64), may_alias));
static_assert(sizeof(V) == sizeof(PnpPoints::Group::Lanes));

struct Sums {
    V A[21];  // lower triangle, row by row
    V g[6];
    V chi2;
    double depth_min;
};

/// R: row-major matrix of the pose; t: the centroid.
NARPA_EACH_ISA void accumulate(std::span<const PnpPoints::Group> groups, const double* R, const double* t,
                               const RobustLoss& loss, Sums& sums) {
    const auto load = [](const PnpPoints::Group::Lanes& lanes) -> const V& {
        return *reinterpret_cast<const V*>(lanes.data());
    };
    V A[21]{}, g[6]{}, chi2{};
    V nearest = V{} + 1e300;
    for (const PnpPoints::Group& p : groups) {
        const V &ax = load(p.x), &ay = load(p.y), &az = load(p.z);
        const V bx = R[0] * ax + R[1] * ay + R[2] * az;
        const V by = R[3] * ax + R[4] * ay + R[5] * az;
        const V bz = R[6] * ax + R[7] * ay + R[8] * az;
        const V depth = bz + t[2];
        nearest = depth < nearest ? depth : nearest;
        const V inverse = 1.0 / depth;
        const V x = (bx + t[0]) * inverse, y = (by + t[1]) * inverse;
        const V &l00 = load(p.l00), &l10 = load(p.l10), &l11 = load(p.l11);
        const V ru = load(p.u) - x, rv = load(p.v) - y;
        const V eu = l00 * ru + l10 * rv, ev = l11 * rv;
        const V s = eu * eu + ev * ev;
        V w = V{} + 1.0;
        if (loss.kind == Loss::none) {
            chi2 += s;
        } else {
            V cost;
            for (std::size_t k = 0; k < PnpPoints::kGroup; ++k) w[k] = loss.weight(s[k]), cost[k] = loss.cost(s[k]);
            chi2 += cost;
        }
        // Rows of the whitened residuals by the point in the camera's frame, d(point) = r x b + d(centroid).
        const V p0 = l00 * inverse, p1 = l10 * inverse, q1 = l11 * inverse;
        const V pz = -(p0 * x + p1 * y), qz = -(q1 * y);
        const V ju[6] = {by * pz - bz * p1, bz * p0 - bx * pz, bx * p1 - by * p0, p0, p1, pz};
        const V jv[6] = {by * qz - bz * q1, -(bx * qz), bx * q1, V{}, q1, qz};
        int entry = 0;
#pragma GCC unroll 6
        for (int i = 0; i < 6; ++i) {
            const V wu = w * ju[i], wv = w * jv[i];
            g[i] += wu * eu + wv * ev;
#pragma GCC unroll 6
            for (int j = 0; j <= i; ++j) A[entry++] += wu * ju[j] + wv * jv[j];
        }
    }
    for (int i = 0; i < 21; ++i) sums.A[i] = A[i];
    for (int i = 0; i < 6; ++i) sums.g[i] = g[i];
    sums.chi2 = chi2;
    sums.depth_min = nearest[0];
    for (std::size_t k = 1; k < PnpPoints::kGroup; ++k)
        if (!(nearest[k] > sums.depth_min)) sums.depth_min = nearest[k];
}

/// s of every lane: infinite behind the camera, 0 for padding.
NARPA_EACH_ISA void square_residuals(std::span<const PnpPoints::Group> groups, const double* R, const double* t,
                                     double* out) {
    const auto load = [](const PnpPoints::Group::Lanes& lanes) -> const V& {
        return *reinterpret_cast<const V*>(lanes.data());
    };
    const V infinite = V{} + std::numeric_limits<double>::infinity();
    for (const PnpPoints::Group& p : groups) {
        const V &ax = load(p.x), &ay = load(p.y), &az = load(p.z);
        const V depth = R[6] * ax + R[7] * ay + R[8] * az + t[2];
        const V inverse = 1.0 / depth;
        const V ru = load(p.u) - (R[0] * ax + R[1] * ay + R[2] * az + t[0]) * inverse;
        const V rv = load(p.v) - (R[3] * ax + R[4] * ay + R[5] * az + t[1]) * inverse;
        const V eu = load(p.l00) * ru + load(p.l10) * rv, ev = load(p.l11) * rv;
        const V s = depth > 0 ? eu * eu + ev * ev : infinite;
        for (std::size_t k = 0; k < PnpPoints::kGroup; ++k) *out++ = s[k];
    }
}

struct Matrix {
    double R[9], t[3];
    explicit Matrix(const CentredPose& pose) {
        const auto c = columns(pose.q);
        for (int i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j) R[3 * i + static_cast<int>(j)] = c[j][i];
        for (int i = 0; i < 3; ++i) t[i] = pose.centroid_m[i];
    }
};

double total(const V& v) {
    return ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
}

}  // namespace

bool PnpPoints::evaluate(const CentredPose& pose, const RobustLoss& loss, NormalEquations& out) const {
    const Matrix m(pose);
    Sums sums;
    accumulate({groups_.data(), (size_ + kGroup - 1) / kGroup}, m.R, m.t, loss, sums);
    if (!(sums.depth_min > 0)) return false;
    for (int i = 0, entry = 0; i < 6; ++i) {
        out.g[i] = total(sums.g[i]);
        for (int j = 0; j <= i; ++j, ++entry) out.A(i, j) = out.A(j, i) = total(sums.A[entry]);
    }
    out.chi2 = total(sums.chi2);
    out.rounding = rounding_;
    return std::isfinite(out.chi2);
}

double PnpPoints::truncated_cost(const CentredPose& pose, double s_max) const {
    const Matrix m(pose);
    double sum = 0;
    for (std::size_t i = 0; i < size_; i += kGroup) {
        std::array<double, kGroup> s;
        square_residuals({&groups_[i / kGroup], 1}, m.R, m.t, s.data());
        for (std::size_t k = 0; k < std::min(kGroup, size_ - i); ++k) sum += std::min(s_max, s[k]);
    }
    return sum;
}

void PnpPoints::squared_residuals(const CentredPose& pose, std::span<double> out) const {
    assert(out.size() >= size_);
    const Matrix m(pose);
    for (std::size_t i = 0; i < size_; i += kGroup) {
        std::array<double, kGroup> s;
        square_residuals({&groups_[i / kGroup], 1}, m.R, m.t, s.data());
        std::copy_n(s.data(), std::min(kGroup, size_ - i), out.data() + i);
    }
}

}  // namespace narpa
