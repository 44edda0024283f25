#include "estimator/cloud/plane_equations.h"

#include <algorithm>
#include <cmath>

namespace narpa {
namespace {

constexpr double kTukey = 4.685;  // tuning constant of the biweight: 95 % of the efficiency of least squares

/// Tukey's biweight at u standard deviations: weight psi(u) / u, and slope psi'(u).
struct Biweight {
    double weight = 0, slope = 0;
    explicit Biweight(double u) {
        const double r = u / kTukey, s = 1 - r * r;
        if (s <= 0) return;
        weight = s * s;
        slope = s * (1 - 5 * r * r);
    }
};

}  // namespace

double PlaneEquations::add(const PlaneResidual& p) {
    const double u = p.distance / scatter_;
    const Biweight robust(u);
    if (robust.weight <= 0) return 0;
    ++used_;
    const Matrix6 JJ = p.by_pose * p.by_pose.transpose();
    hessian_ += robust.weight * JJ;
    gradient_ -= robust.weight * p.distance * p.by_pose;
    information_ += JJ;
    by_common_ -= robust.weight * p.by_pose * p.by_common;
    by_scale_ -= robust.weight * p.by_scale * p.by_pose;
    scale_hessian_ += robust.weight * p.by_scale * p.by_scale;
    scale_gradient_ -= robust.weight * p.distance * p.by_scale;
    scores2_ += std::pow(robust.weight * u, 2);
    slopes_ += robust.slope;
    slopes2_ += robust.slope * robust.slope;
    const double weight = robust.weight / (p.sigma_m * p.sigma_m);
    spread_.weight += weight;
    spread_.centre_m += weight * p.at_m;
    moment_ += weight * dot(p.at_m, p.at_m);
    return robust.weight;
}

void PlaneEquations::finish(double scale, double scale_sigma) {
    if (scale_sigma > 0) {
        size_is_known_ = false;
        scale_hessian_ += 1 / (scale_sigma * scale_sigma);
        scale_gradient_ -= scale / (scale_sigma * scale_sigma);
    }
    spread_.centre_m = spread_.centre_m / spread_.weight;
    const Vec3& c = spread_.centre_m;
    spread_.radius_m = std::sqrt(std::max(1e-18, moment_ / spread_.weight - dot(c, c)));
}

PlaneEquations::Step PlaneEquations::step(const Observability& observability) const {
    Step s{pose_step(observability)};
    if (size_is_known_) return s;
    const Vector6 by_scale = observability.solve(hessian_, by_scale_);
    s.scale = (scale_gradient_ + by_scale_.dot(s.pose)) / (scale_hessian_ - by_scale_.dot(by_scale));
    s.pose += s.scale * by_scale;
    return s;
}

PoseShifts PlaneEquations::shifts(const Observability& observability) const {
    PoseShifts out = PoseShifts::Zero(6, 4);
    for (int i = 0; i < 3; ++i) out.col(i) = observability.solve(hessian_, by_common_.col(i));
    if (size_is_known_) return out;
    const Vector6 by_scale = observability.solve(hessian_, by_scale_);
    out.col(3) = by_scale / std::sqrt(scale_hessian_ - by_scale_.dot(by_scale));
    return out;
}

double PlaneEquations::variance_factor() const {
    constexpr double kUnknowns = 6;
    const auto n = static_cast<double>(used_);
    const double slope = slopes_ / n, slope_variance = std::max(0.0, slopes2_ / n - slope * slope);
    if (!(n > kUnknowns && slope > 0)) return kUnobservedSigma * kUnobservedSigma;
    const double correction = 1 + kUnknowns / n * slope_variance / (slope * slope);
    const double mean_square = scores2_ / (n - kUnknowns);
    return std::max(1.0, std::pow(correction * scatter_ / slope, 2) * mean_square);
}

}  // namespace narpa
