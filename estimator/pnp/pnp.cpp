#include "estimator/pnp/pnp.h"

#include <algorithm>
#include <utility>

namespace narpa {
namespace {

constexpr double kFlatSigma = 3;               // a body thinner than this in the image is treated as flat
constexpr double kReversibleSigma = 20;        // thicker than this, the reversed pose cannot fit
constexpr std::size_t kPointsUnambiguous = 6;  // with fewer, wrong minima fit within the noise

double typical_sigma_px(const PnpInput& input) {
    if (input.covariance_px2.empty()) return input.sigma_px;
    double sum = 0;
    for (const PixelCovariance& s : input.covariance_px2) sum += 0.5 * (s.uu + s.vv);
    return std::sqrt(sum / static_cast<double>(input.covariance_px2.size()));
}

/// Approximate extent of the body's thinnest direction in the image, in standard deviations of a pixel.
double depth_in_sigma(const PnpInput& input, std::span<const BodyPoint> points, const PointExtent& spread) {
    double mean_u = 0, mean_v = 0, sum = 0;
    const double n = static_cast<double>(points.size());
    for (const BodyPoint& p : points) {
        mean_u += p.seen.u / n, mean_v += p.seen.v / n;
        sum += p.seen.u * p.seen.u + p.seen.v * p.seen.v;
    }
    const double seen_rms = std::sqrt(std::max(0.0, sum / n - mean_u * mean_u - mean_v * mean_v));
    return input.camera->pixels_per_radian() * seen_rms * spread.rms_m.z /
           (spread.rms_m.x * typical_sigma_px(input));
}

bool same_minimum(const PnpFit& a, const PnpFit& b) {
    const Vector6 e = error_between(a.T_camera_body, b.T_camera_body);
    if (e.head<3>().norm() < 1e-9 && e.tail<3>().norm() < 1e-9 * norm(a.T_camera_body.t)) return true;
    return normalised_error_squared(e, a.covariance) < 0.01;
}

}  // namespace

PnpSolver::PnpSolver(std::size_t points_max) : points_(points_max), all_(points_max) {
    gathered_.reserve(points_max);
    squared_.resize(points_max);
    flags_.resize(points_max);
    solution_.inlier.reserve(points_max);
}

const PnpSolution& PnpSolver::solve(const PnpInput& input, bool outliers) {
    solution_.status = check(input);
    solution_.has_second = solution_.imprecise = false;
    solution_.fit.chi2 = std::numeric_limits<double>::infinity();
    solution_.fit.status = PnpStatus::behind_camera;
    solution_.inliers = input.body_m.size();
    if (!solution_.ok()) return solution_;
    if (input.body_m.size() > points_.capacity()) {
        solution_.status = PnpStatus::too_many_points;
        return solution_;
    }
    if (input.body_m.size() < 4) {
        solution_.status = PnpStatus::too_few_points;
        return solution_;
    }
    solution_.inlier.assign(input.body_m.size(), 1);
    points_.assign(input);
    gather();
    const PointExtent spread = extent_of(gathered_);
    if (spread.is_a_line()) {
        solution_.status = PnpStatus::degenerate;
        return solution_;
    }
    outliers ? solve_with_outliers(input) : solve_all(input, spread);
    if (solution_.status != PnpStatus::converged) return solution_;
    solution_.status = solution_.fit.status;
    solution_.imprecise = solution_.fit.ok() && !(solution_.fit.relative_position_sigma() <= kImpreciseSigma);
    return solution_;
}

void PnpSolver::solve_all(const PnpInput& input, const PointExtent& spread) {
    const double depth = depth_in_sigma(input, gathered_, spread);
    const bool few = points_.size() < kPointsUnambiguous;
    const auto fits = [&] { return fits_the_noise(solution_.fit.chi2, solution_.fit.degrees_of_freedom); };
    const InitialPoses starts = orthographic_poses(gathered_, spread, depth < kFlatSigma);
    for (std::size_t i = 0; i < starts.count; ++i) consider(starts.pose[i]);
    if (!fits())
        if (const auto start = sqpnp_pose(gathered_)) consider(*start);
    if (few || depth < kReversibleSigma || !fits()) consider_reversed(spread);
}

void PnpSolver::gather() {
    gathered_.clear();
    for (std::size_t i = 0; i < points_.size(); ++i)
        gathered_.push_back({points_.centred_body_m(i), points_.normalised(i)});
}

void PnpSolver::consider(const CentredPose& start) {
    refine(points_, points_.uncentred(start), {}, trial_);
    if (trial_.status == PnpStatus::behind_camera || trial_.status == PnpStatus::not_finite) return;
    PnpFit& first = solution_.fit;
    PnpFit& second = solution_.second;
    if (!std::isfinite(first.chi2)) {
        first = trial_;
    } else if (same_minimum(first, trial_)) {
        if (trial_.chi2 < first.chi2) first = trial_;
    } else if (trial_.chi2 < first.chi2) {
        second = first, first = trial_;
        solution_.has_second = true;
    } else if (!solution_.has_second || trial_.chi2 < second.chi2) {
        second = trial_;
        solution_.has_second = true;
    }
}

void PnpSolver::consider_reversed(const PointExtent& spread) {
    if (!std::isfinite(solution_.fit.chi2)) return;
    consider(depth_reversed(points_.centred(solution_.fit.T_camera_body), spread));
}

bool fits_the_noise(double chi2, double degrees_of_freedom) noexcept {
    return chi2 < degrees_of_freedom + kMaxChi2Sigmas * std::sqrt(2 * degrees_of_freedom);
}

Answer PnpSolution::answer() const {
    Fit f;
    if (!ok()) {
        f.failed = to_text(status);
        return judge(std::move(f));
    }
    const double freedom = std::max(1, fit.degrees_of_freedom);
    f.residual = std::sqrt(fit.chi2 / freedom);
    f.residual_max = std::sqrt(1 + kMaxChi2Sigmas * std::sqrt(2 / freedom));
    observe(fit.T_camera_body, fit.covariance, f);
    const double worse = second.chi2 - fit.chi2;
    if (has_second && worse < kRival_chi2) f.rivals.push_back({second.T_camera_body, worse});
    return judge(std::move(f));
}

}  // namespace narpa
