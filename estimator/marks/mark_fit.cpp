#include "estimator/marks/mark_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/constants.h"

namespace narpa {
namespace {

constexpr int kReweightings = 4;
/// From fewer degrees of freedom the scatter is not estimated: it is one.
constexpr int kFewestFreedom = 5;
/// Variance of a centroid in images sampled at the centres of pixels, over variance_of_disc(): 0.2 to 0.5 for radii
/// from 0.7 to 4.4 px. Discs at equal places between pixel centres have equal errors, which the residuals of the
/// fit do not show: so the scatter is at least this, and a part of it is added for a shift that all discs have in
/// common.
constexpr double kSampledAtCentres = 0.25, kInCommon = 0.5;

double squared(const Pixel& r, const PixelCovariance& c) {
    return (c.vv * r.u * r.u - 2 * c.uv * r.u * r.v + c.uu * r.v * r.v) / (c.uu * c.vv - c.uv * c.uv);
}

}  // namespace

MarkFit::MarkFit(const Camera& camera, const RowTimes& times, const ApparentMotion& motion, MarkPoints marks,
                 const Rigid3& near)
    : camera_(camera.model), marks_(std::move(marks)), freedom_(marks_.numbers() - 6) {
    for (const MarkPoint& p : marks_.points()) seen_.push_back(p.seen);
    PnpSolver solver(seen_.size());
    Rigid3 T = near;
    for (int round = 0; round < kReweightings; ++round) {
        body_m_.clear();
        for (const MarkPoint& p : marks_.points()) body_m_.push_back(p.body_m);
        to_mid_exposure(T, motion, times, seen_, body_m_);
        covariances_ = marks_.covariances(scatter_);
        solution_ = solver.solve(input(covariances_));
        if (!solution_.ok()) return;
        T = solution_.fit.T_camera_body;
        chi2_ = chi2_at(T, 1);
        const double before = scatter_;
        if (freedom_ >= kFewestFreedom)
            scatter_ = std::max(scatter_at(T), kSampledAtCentres * marks_.undersampled());
        if (std::abs(scatter_ - before) < 1e-3 * before) break;
    }
}

Matrix6 MarkFit::covariance() const {
    const Rigid3& T = solution_.fit.T_camera_body;
    const double scatter = kInCommon * kSampledAtCentres * marks_.undersampled();
    Eigen::Matrix<double, 6, 2> gradient = Eigen::Matrix<double, 6, 2>::Zero();
    for (std::size_t i = 0; i < seen_.size(); ++i) {
        const MarkPoint& p = marks_.points()[i];
        if (p.numbers != 2) continue;
        const PixelCovariance& c = covariances_[i];
        Eigen::Matrix2d covariance;
        covariance << c.uu, c.uv, c.uv, c.vv;
        gradient += std::sqrt(scatter * p.beyond.uu) *
                    (reprojection_jacobian(*camera_, T, body_m_[i]).transpose() * covariance.inverse());
    }
    const Eigen::Matrix<double, 6, 2> moved = solution_.fit.covariance * gradient;
    return solution_.fit.covariance + moved * moved.transpose();
}

PointObservations MarkFit::observations() const {
    PointObservations out;
    out.body_m = body_m_, out.seen = seen_;
    const double common = kInCommon * kSampledAtCentres * marks_.undersampled();
    for (const MarkPoint& p : marks_.points()) {
        out.noise.push_back(p.noise), out.beyond.push_back(p.beyond), out.numbers.push_back(p.numbers);
        out.common_px.push_back(p.numbers == 2 ? std::sqrt(common * p.beyond.uu) : 0);
    }
    out.scatter_min = kSampledAtCentres * marks_.undersampled();
    return out;
}

PnpInput MarkFit::input(std::span<const PixelCovariance> covariances) const {
    return {camera_.get(), body_m_, seen_, 1, covariances};
}

double MarkFit::chi2_at(const Rigid3& T, double scatter) const {
    const auto covariances = marks_.covariances(scatter);
    double sum = 0;
    for (std::size_t i = 0; i < seen_.size(); ++i) {
        const auto p = camera_->project(T * body_m_[i]);
        if (!p) return kInfinity;
        sum += squared({seen_[i].u - p->x, seen_[i].v - p->y}, covariances[i]);
    }
    return sum;
}

/// Where chi2 is two less than the degrees of freedom: the mean of 1 / scatter is then right (Student's t). 0 where
/// the sensor's noise explains the residuals.
double MarkFit::scatter_at(const Rigid3& T) const {
    constexpr int kBisections = 40;
    constexpr double kMost = 1e6;
    const double expected = freedom_ - 2;
    double low = 0, high = 1;
    while (chi2_at(T, high) > expected && high < kMost) high *= 2;
    for (int i = 0; i < kBisections; ++i) {
        const double middle = (low + high) / 2;
        (chi2_at(T, middle) > expected ? low : high) = middle;
    }
    return high;
}

}  // namespace narpa
