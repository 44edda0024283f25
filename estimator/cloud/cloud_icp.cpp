#include "estimator/cloud/cloud_icp.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/constants.h"
#include "estimator/least_squares/median.h"
#include "estimator/least_squares/symmetric.h"
#include "estimator/uncertainty/observed_error.h"
#include "estimator/uncertainty/root_information.h"
#include "estimator/uncertainty/share.h"

namespace narpa {
namespace {

constexpr std::size_t kSearchPoints = 100;  ///< approximate number of the sweep's points that the search uses
constexpr int kSearchIterations = 10;       ///< of the search, each with a smaller radius
constexpr double kUnobservedBelow = 1e-3;   ///< normalised eigenvalue (observability.h)
constexpr double kLastRadius = 0.02;        ///< last search radius over the first
constexpr double kExplained = 4;            ///< standard deviations within which a point lies on the model
constexpr double kOutlierCost = 0.5 * kExplained * kExplained, kUsualCost = 0.5;
/// An estimate may have rivals if it has fewer points, a smaller normalised eigenvalue, a larger part of points off
/// the model, or a cost this many standard deviations above that of noise.
constexpr std::size_t kManyPoints = 150;
constexpr double kWeakEigenvalue = 0.01, kPartElsewhereMax = 0.02, kMoreThanNoise_sigmas = 4;
/// Rivals are searched about the best of them, repeatedly, at most this many times.
constexpr int kRivalSearchesMax = 4;
/// A rival is better if its cost (half a chi-square) is smaller by at least this.
constexpr double kBetter = 0.5;
/// Radius of a repeated search about a minimum with points beside the model, over the points' RMS radius.
constexpr double kRefitRadius = 0.15;
/// Radius about a beam in which other surfaces are searched, in standard deviations of the range.
constexpr double kElsewhere_sigmas = 2;
/// An answer further from the guess than this many times the search radius is a symmetric pose of the target, or
/// another target.
constexpr double kSearched = 2.5;

/// Upper bound of the motion of surfaces within `reach_m` of the target's origin.
double surface_motion_m(const Vector6& pose_step, double reach_m) {
    return pose_step.tail<3>().norm() + pose_step.head<3>().norm() * reach_m;
}

/// True if, along some observed motion, more than the part kMax of the information comes from points not in
/// `some`.
bool rests_on_others(const CheckedInformation& all, const CheckedInformation& some) {
    constexpr double kMax = 0.75;
    const Observability& o = all.observability;
    if (o.unobserved == 6 || some.observability.unobserved > o.unobserved) return o.unobserved < 6;
    const Matrix6 L = cholesky(o.along_motions(all.information)).L;
    const Matrix6 half = lower_solve(L, o.along_motions(some.information));
    const Matrix6 parts = lower_solve(L, Matrix6(half.transpose()));  // L^-1 some L'^-1; 1 along unobserved motions
    return !(symmetric_eigen(parts).values[0] > 1 - kMax);
}

Status check_start(const Rigid3& T) {
    if (!is_finite(T.t) || !(std::abs(norm(T.q) - 1) < 1e-6))
        return Error{"the pose to start from: expected a finite position and a unit quaternion"};
    return Ok{};
}

}  // namespace

double search_radius_m(double position_sigma_m, double rotation_sigma_rad, double reach_m) {
    constexpr double kSigmas = 4, kNear_m = 0.3;
    const double radius_m = kSigmas * (position_sigma_m + rotation_sigma_rad * reach_m);
    return radius_m > kNear_m ? radius_m : 0;
}

/// Sets covariance, bound and root information. `information`: that of the points the answer may rest on.
void CloudIcp::set_covariance(const PlaneEquations& equations, const Matrix6& information,
                              CloudEstimate& out) const {
    const double factor = equations.variance_factor();
    const Observability& o = out.observability;
    PoseShifts by_model = PoseShifts::Zero(6, 0);
    if (settings_.model != ModelUncertainty{} || have_common_errors_)
        by_model = joined(pose_shifts(settings_.model, out.T_lidar_target, motion_), equations.shifts(o));
    out.covariance_of_model = covariance_by(by_model);
    out.bound = o.covariance(equations.information(), 1, start_covariance_) + out.covariance_of_model;
    out.covariance = o.covariance(information, factor, start_covariance_) + out.covariance_of_model;
    out.root_information = root_information_with(o.root_information(information, factor), by_model);
}

/// Information of the points, of those last linearised at T, that the answer may rest on: checked by others, and
/// not possibly on another surface. Marks the others in rows_.
CheckedInformation CloudIcp::check_points(const PlaneEquations& equations, const Rigid3& T) {
    CheckedInformation checked = checked_information(rows_, equations.spread(), kUnobservedBelow);
    checked_rows_ = rows_;
    const double radius_m = kElsewhere_sigmas * settings_.noise.range_m;
    for (WeightedRow& row : rows_)
        row.checked = !association_.may_be_on_other_surface(T, settings_.noise, radius_m, row.measurement,
                                                            planes_[row.measurement]);
    const CheckedInformation on_one = checked_information(rows_, equations.spread(), kUnobservedBelow);
    if (rests_on_others(checked, on_one)) return on_one;
    std::swap(rows_, checked_rows_);
    return checked;
}

/// Gauss-Newton step by the points marked as checked.
Vector6 CloudIcp::step_of_checked(const CheckedInformation& checked) const {
    Vector6 gradient = Vector6::Zero();
    for (const WeightedRow& row : rows_) {
        const PointToPlane& p = planes_[row.measurement];
        if (row.checked) gradient -= row.weight * p.distance_m / p.sigma_m * row.derivative;
    }
    return checked.observability.solve(checked.hessian, gradient);
}

/// Along the motions that then rest on no point, the pose returns to the start.
void CloudIcp::leave_out_unchecked_points(const Rigid3& start, CloudEstimate& out) {
    constexpr int kSteps = 5;
    const int unobserved = out.observability.unobserved;
    association_.set_scale(1 + out.scale);
    association_.find_edges(out.T_lidar_target, settings_.noise);
    for (int i = 0;; ++i) {
        const auto equations = linearise(out.T_lidar_target, 0, 1, out);
        if (!equations) return;
        const CheckedInformation checked = check_points(*equations, out.T_lidar_target);
        out.unchecked = checked.unchecked;
        out.observability = checked.observability;
        set_covariance(*equations, checked.information, out);
        if (checked.observability.unobserved == unobserved || checked.observability.unobserved == 6 || i == kSteps)
            return;
        out.T_lidar_target = nearest_equivalent(displaced(out.T_lidar_target, step_of_checked(checked)),
                                                checked.observability, start);
    }
}

/// Shifts of a point's range by one standard deviation of each common error.
Eigen::RowVector3d CloudIcp::common_errors_m(const RangePoint& p) const {
    return {settings_.model.range_bias_m, p.common_m[0], p.common_m[1]};
}

std::optional<PlaneEquations> CloudIcp::linearise(const Rigid3& T, double search_m, std::size_t stride,
                                                  CloudEstimate& out) {
    association_.set_scale(1 + out.scale);
    association_.associate(T, settings_.noise, search_m, stride, planes_);
    magnitudes_.clear();
    rows_.clear();
    for (const PointToPlane& p : planes_)
        if (p.fate == BeamClass::met) magnitudes_.push_back(std::abs(p.distance_m) / p.sigma_m);
    out.points = planes_.size();
    out.used = out.missed = out.edges = out.grazing = out.rejected = out.explained = 0;
    out.cost = 0;
    if (magnitudes_.size() < kFewestSweepPoints) return {};
    PlaneEquations equations(std::max(1.0, kMadToSigma * upper_median(std::span(magnitudes_))));
    for (std::size_t k = 0; k < planes_.size(); ++k) {
        const PointToPlane& p = planes_[k];
        out.missed += p.fate == BeamClass::missed;
        out.grazing += p.fate == BeamClass::grazing;
        out.edges += p.fate == BeamClass::edge;
        if (p.fate == BeamClass::missed) out.cost += kOutlierCost;
        if (p.fate == BeamClass::edge) out.cost += kUsualCost;
        if (p.fate != BeamClass::met) continue;
        const double e = p.distance_m / p.sigma_m;
        out.explained += std::abs(e) < kExplained;
        out.cost += std::min(0.5 * e * e, kOutlierCost);
        const Vector6 by_pose = association_.derivative(T, k * stride, p) / p.sigma_m;
        const double weight = equations.add({.distance = e,
                                             .by_pose = by_pose,
                                             .by_common = association_.along_beam(T, k * stride, p) / p.sigma_m *
                                                          common_errors_m(points_[k * stride]),
                                             .by_scale = -dot(p.normal, p.surface_m) / p.sigma_m,
                                             .sigma_m = p.sigma_m,
                                             .at_m = T.q * p.surface_m});
        if (weight > 0)
            rows_.push_back({by_pose, weight, k});
        else
            ++out.rejected;
    }
    out.used = equations.used();
    if (out.used < kFewestSweepPoints) return {};
    const double sigma = settings_.model.scale;
    if (sigma > 0) out.cost += 0.5 * std::pow(out.scale / sigma, 2);
    equations.finish(out.scale, sigma);
    out.observability = observability(equations.hessian(), equations.spread(), kUnobservedBelow);
    out.radius_m = equations.spread().radius_m;
    return equations;
}

Rigid3 CloudIcp::search(const Rigid3& start, double search_m, std::size_t points, int radii, CloudEstimate& out) {
    const std::size_t stride = std::max<std::size_t>(1, association_.size() / points);
    const double narrower = std::pow(kLastRadius, 1.0 / (radii - 1));
    Rigid3 T = start;
    for (int i = 0; i < radii; ++i, search_m *= narrower) {
        const auto equations = linearise(T, search_m, stride, out);
        if (!equations) break;
        T = displaced(T, equations->pose_step(out.observability));
        ++out.iterations;
    }
    return T;
}

CloudEstimate CloudIcp::attempt(const Rigid3& start, double search_m, std::size_t points, int radii) {
    CloudEstimate out;
    Rigid3& T = out.T_lidar_target;
    T = search_m > 0 ? search(start, search_m, points, radii, out) : start;
    Vector6 last = Vector6::Zero();
    double damping = 1, moved_m = 0;  // moved_m: motion since edges were found
    for (int i = 0;; ++i) {
        if (i == 0 || (out.settled && moved_m > edges_hold_m() && i < settings_.iterations)) {
            association_.set_scale(1 + out.scale);
            association_.find_edges(T, settings_.noise);
            moved_m = 0;
            out.settled = false;
        }
        const auto equations = linearise(T, 0, 1, out);
        if (!equations) break;
        if (out.settled || i == settings_.iterations) {
            set_covariance(*equations, equations->information(), out);
            break;
        }
        auto [step, larger] = equations->step(out.observability);
        out.scale += larger;
        const Matrix6& hessian = equations->hessian();
        // Steps that alternate between two sets of correspondences: damp them, to end between the two.
        if (step.dot(hessian * last) < 0) damping *= 0.5;
        step *= damping;
        T = displaced(T, step);
        moved_m += surface_motion_m(step, association_.reach_m());
        ++out.iterations;
        out.settled = step.dot(hessian * step) < std::pow(settings_.settled * equations->scatter(), 2);
        last = step;
    }
    out.on_model = share_is_more(out.explained, out.points - out.edges, settings_.min_inlier_share);
    return out;
}

/// Largest motion of the surfaces for which the edges found stay valid: the searched cone is wider by as much.
double CloudIcp::edges_hold_m() const {
    if (!(settings_.noise.footprint_rad > 0)) return kInfinity;
    return 0.05 * settings_.noise.footprint_rad * association_.nearest_m();
}

/// Moves the pose back to the start along the motions that the sweep does not observe: in a search, few points and
/// their noise move it there. A pose that then fits worse than noise explains was observed, and stays.
void CloudIcp::return_to_start(CloudEstimate& found, const Rigid3& start) {
    if (found.used < kFewestSweepPoints || found.observability.unobserved == 0 ||
        found.observability.unobserved == 6)
        return;
    const Rigid3 back = nearest_equivalent(found.T_lidar_target, found.observability, start);
    CloudEstimate again = attempt(back, 0, kSearchPoints, kSearchIterations);
    again.iterations += found.iterations;
    if (!again.settled || again.cost > found.cost + 0.5 * kRival_chi2) return;
    again.rivals = std::move(found.rivals);
    found = std::move(again);
}

/// Beams that miss the model have no residual, so the fit may leave a face short of its edge. Repeats the search
/// about the minimum, so that these beams find a surface.
void CloudIcp::refit_missed_beams(CloudEstimate& found) {
    for (int i = 0; i < 3; ++i) {
        if (found.used < kFewestSweepPoints || found.explained + found.grazing + found.edges >= found.points)
            return;
        CloudEstimate again =
            attempt(found.T_lidar_target, kRefitRadius * found.radius_m, 4 * kSearchPoints, kSearchIterations);
        again.iterations += found.iterations;
        if (!(again.settled && again.cost < found.cost - kBetter)) return;
        found = again;
    }
}

/// True for an estimate with few points, a weakly observed motion, points off the model, or larger residuals than
/// noise explains.
bool CloudIcp::may_have_rivals(const CloudEstimate& e) {
    const Observability& o = e.observability;
    const auto elsewhere = static_cast<double>(e.points - e.explained - e.grazing - e.edges);
    // Half of a chi-square; its standard deviation is the square root of its mean.
    const double of_noise = 0.5 * static_cast<double>(e.points - e.edges);
    return e.used < kManyPoints || o.eigenvalues[o.unobserved] < kWeakEigenvalue ||
           elsewhere > kPartElsewhereMax * static_cast<double>(e.points) ||
           e.cost > of_noise + kMoreThanNoise_sigmas * std::sqrt(of_noise);
}

/// Looks for equally good minima, starting at poses one search radius away along the two least observed motions.
/// Keeps the best; another that is nearly as likely becomes a rival. True if a better one was found: the caller
/// then repeats this about it, as still better ones may exist.
bool CloudIcp::search_rivals(CloudEstimate& found, double search_m) {
    if (found.used < kFewestSweepPoints || found.observability.unobserved > 4 || !may_have_rivals(found))
        return false;
    const CloudEstimate first = found;
    for (const int motion : {first.observability.unobserved, first.observability.unobserved + 1})
        for (const double side : {-search_m, search_m}) {
            const Rigid3 start = displaced(first.T_lidar_target, side * first.observability.motions.col(motion));
            CloudEstimate rival = attempt(start, search_m, 2 * kSearchPoints, kSearchIterations);
            refit_missed_beams(rival);
            found.iterations += rival.iterations;
            if (!rival.settled || rival.used < kFewestSweepPoints) continue;
            const bool better = rival.cost < found.cost - kBetter;
            const Matrix6& root = better ? rival.root_information : found.root_information;
            const Vector6 apart = error_between(found.T_lidar_target, rival.T_lidar_target);
            const bool elsewhere = (root * apart).squaredNorm() > kDistinctPose_chi2;
            const double worse_chi2 = 2 * std::abs(rival.cost - found.cost);
            if (!better && !(elsewhere && worse_chi2 < kRival_chi2)) continue;
            if (empty_beams_.count(rival.T_lidar_target, rival.covariance).refutes()) continue;
            if (better) {
                rival.iterations = found.iterations;
                std::swap(rival, found);
                if (!elsewhere) found.rivals = std::move(rival.rivals);
            }
            if (elsewhere && worse_chi2 < kRival_chi2) found.rivals.push_back({rival.T_lidar_target, worse_chi2});
        }
    return found.cost < first.cost - kBetter;
}

Answer CloudIcp::answer_of(const CloudEstimate& e, const Rigid3& start, double search_m) const {
    Fit fit;
    compare_with_guess(e.T_lidar_target, start, fit);
    const double moved_m = surface_motion_m(fit.moved, association_.reach_m());
    if (!e.settled)
        fit.failed = fmt::format("still moving after {} iterations", e.iterations);
    else if (!e.on_model)
        fit.failed = fmt::format(
            "{} of {} points lie on the model, expected {:.0f} % with a confidence of 95 %: {} or more "
            "if all do",
            e.explained, e.points - e.edges, 100 * settings_.min_inlier_share,
            fewest_for_share(settings_.min_inlier_share));
    else if (const EmptyBeamCount& b = e.empty_beams; b.refutes())
        fit.failed =
            fmt::format("{} beams without return pass through the model, in {} stretches; {} beams meet it",
                        b.empty, b.stretches, b.returned);
    else if (search_m > 0 && e.observability.unobserved == 0 && moved_m > kSearched * search_m)
        fit.failed =
            fmt::format("surfaces are {:.3g} m from the guess, expected at most {:.3g} m, {:g} times the search",
                        moved_m, kSearched * search_m, kSearched);
    fit.observability = e.observability;
    fit.root_information = e.root_information;
    fit.rivals = e.rivals;
    return judge(std::move(fit));
}

Status CloudIcp::begin(std::span<const RangePoint> points, const ApparentMotion& motion,
                       std::span<const EmptyBeam> empty) {
    if (auto good = check_sweep(points, empty); !good) return good;
    if (!is_finite(motion.velocity_m_s) || !is_finite(motion.rate_rad_s))
        return Error{"the motion during the sweep is not finite"};
    association_.take(points, motion);
    empty_beams_.take(points, empty, motion);
    points_ = points;
    motion_ = motion;
    have_common_errors_ =
        std::ranges::any_of(points, [](const RangePoint& p) { return p.common_m != decltype(p.common_m){}; });
    planes_.reserve(points.size());
    magnitudes_.reserve(points.size());
    rows_.reserve(points.size());
    checked_rows_.reserve(points.size());
    return Ok{};
}

CloudIcp::Approach CloudIcp::approach(const Rigid3& start, double search_m) {
    constexpr int kMoves = 2;
    const std::size_t stride = std::max<std::size_t>(1, association_.size() / kSearchPoints);
    Rigid3 T = start;
    association_.set_scale(1);
    for (int i = 0; i < kMoves; ++i) {
        association_.associate(T, settings_.noise, 0, stride, planes_);
        Vec3 seen_m, met_m;
        double met = 0;
        for (std::size_t k = 0; k < planes_.size(); ++k) {
            seen_m = seen_m + points_[k * stride].position_m();
            if (planes_[k].fate == BeamClass::missed) continue;
            met_m = met_m + T * planes_[k].surface_m;
            ++met;
        }
        if (met == 0) break;
        T.t = T.t + seen_m / static_cast<double>(planes_.size()) - met_m / met;
    }
    CloudEstimate out;
    T = search(T, search_m, kSearchPoints, kSearchIterations, out);
    static_cast<void>(linearise(T, 0, stride, out));
    return {T, out.used > 0 ? out.cost : kOutlierCost * static_cast<double>(planes_.size())};
}

Result<CloudEstimate> CloudIcp::align(std::span<const RangePoint> points, const ApparentMotion& motion,
                                      const Rigid3& start, double search_m, std::span<const EmptyBeam> empty,
                                      const std::optional<Matrix6>& start_covariance) {
    if (auto good = begin(points, motion, empty); !good) return good.error();
    if (auto good = check_start(start); !good) return good.error();
    if (!(search_m >= 0 && std::isfinite(search_m)))
        return Error{"search_m = " + std::to_string(search_m) + ": expected a distance >= 0 m"};
    start_covariance_ = start_covariance;
    CloudEstimate out = attempt(start, search_m, kSearchPoints, kSearchIterations);
    if (search_m > 0 && !(out.settled && out.on_model)) {
        CloudEstimate again = attempt(start, search_m, 4 * kSearchPoints, 3 * kSearchIterations / 2);
        again.iterations += out.iterations;
        if (again.explained > out.explained) out = again;
    }
    refit_missed_beams(out);
    if (search_m > 0)
        for (int k = 0; k < kRivalSearchesMax && search_rivals(out, search_m); ++k) {
        }
    if (out.used < kFewestSweepPoints) {
        out.answer.why =
            fmt::format("only {} of {} points meet the target where it is taken to be, expected at least {}",
                        out.used, points.size(), kFewestSweepPoints);
        return out;
    }
    return_to_start(out, start);
    leave_out_unchecked_points(start, out);
    out.empty_beams = empty_beams_.count(out.T_lidar_target, out.covariance);
    out.answer = answer_of(out, start, search_m);
    return out;
}

}  // namespace narpa
