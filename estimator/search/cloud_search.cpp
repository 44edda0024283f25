#include "estimator/search/cloud_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/search/attitude_grid.h"
#include "estimator/search/template_matcher.h"

namespace narpa {
namespace {

/// Search radii of the approach and of the fit to all points, over the target's radius.
constexpr double kApproachRadius = 0.6, kFitRadius = 0.1;
/// Minimum difference in attitude between the poses from which fits start.
constexpr double kStartsApart_deg = 6;

using Approach = CloudIcp::Approach;

/// The best approaches that differ in attitude, in order of cost.
std::vector<Approach> best_apart(std::vector<Approach> all, std::size_t most, double radius_m) {
    std::ranges::stable_sort(all, {}, &Approach::cost);
    std::vector<Approach> apart;
    for (const Approach& a : all) {
        if (apart.size() == most) break;
        const bool elsewhere = std::ranges::all_of(apart, [&](const Approach& other) {
            const double turn = angle_between(a.T_lidar_target.q, other.T_lidar_target.q);
            return turn > kStartsApart_deg * kDegree ||
                   norm(a.T_lidar_target.t - other.T_lidar_target.t) > kFitRadius * radius_m;
        });
        if (elsewhere) apart.push_back(a);
    }
    return apart;
}

/// True if nothing in the sweep refutes the pose.
bool is_possible(const CloudEstimate& e) {
    return e.settled && e.on_model && !e.empty_beams.refutes();
}

}  // namespace

Result<CloudEstimate> CloudSearch::find(std::span<const RangePoint> points, const ApparentMotion& motion,
                                        std::span<const EmptyBeam> empty, const CloudSearchOptions& options) {
    if (options.attitudes < 1 || options.finished < 1) return Error{"attitudes and finished: expected at least 1"};
    if (auto good = icp_.begin(points, motion, empty); !good) return good.error();
    Vec3 middle_m;
    for (const RangePoint& p : points) middle_m = middle_m + p.position_m() / static_cast<double>(points.size());
    const double radius_m = apparent_radius_m(tracer_, target_);
    const Vec3 behind_m = middle_m + (norm(middle_m) > 0 ? 0.4 * radius_m * normalized(middle_m) : Vec3{});
    std::vector<Approach> approaches;
    for (const Quat& q : attitude_grid(options.attitudes))
        approaches.push_back(
            icp_.approach({q, behind_m - q * tracer_.bounds(target_).centre_m}, kApproachRadius * radius_m));

    std::vector<CloudEstimate> fits;
    for (const Approach& a :
         best_apart(std::move(approaches), static_cast<std::size_t>(options.finished), radius_m))
        if (auto fit = icp_.align(points, motion, a.T_lidar_target, kFitRadius * radius_m, empty))
            fits.push_back(*std::move(fit));
        else
            return fit.error();
    std::erase_if(fits, [](const CloudEstimate& e) { return e.used < kFewestSweepPoints; });
    if (fits.empty()) {
        CloudEstimate none;
        none.points = points.size();
        none.answer.why =
            fmt::format("none of {} attitudes leads to a pose of {} points", options.attitudes, points.size());
        return none;
    }
    std::ranges::stable_sort(fits, [](const CloudEstimate& a, const CloudEstimate& b) {
        return is_possible(a) != is_possible(b) ? is_possible(a) : a.cost < b.cost;
    });
    // Restart from the fit itself: its distance from the grid attitude must not count against it.
    auto again = icp_.align(points, motion, fits.front().T_lidar_target, kFitRadius * radius_m, empty);
    if (!again) return again.error();
    CloudEstimate best = *std::move(again);
    if (!best.answer.usable()) return best;
    Fit judged;
    judged.observability = best.observability;
    judged.root_information = best.root_information;
    for (const CloudEstimate& other : std::span(fits).subspan(1)) {
        const double worse_chi2 = 2 * (other.cost - best.cost);
        const Vector6 apart = error_between(best.T_lidar_target, other.T_lidar_target);
        if (is_possible(other) && worse_chi2 < kRival_chi2 &&
            (best.root_information * apart).squaredNorm() > kDistinctPose_chi2)
            judged.rivals.push_back({other.T_lidar_target, worse_chi2});
    }
    best.rivals = judged.rivals;
    best.answer = judge(std::move(judged));
    return best;
}

}  // namespace narpa
