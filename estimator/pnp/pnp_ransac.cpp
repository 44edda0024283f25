#include <algorithm>
#include <random>

#include "estimator/pnp/pnp.h"

namespace narpa {
namespace {

constexpr double kSampleSquaredResidual = 36;  // a pose of three noisy points misses the others by more than noise
constexpr double kProbabilityMissed = 1e-4;    // probability that no sample was clean
constexpr std::size_t kInliersMin = 5;
constexpr int kHypothesesMax = 2000;
constexpr double kInliersPart = 0.25;  // of all points, at least
const RobustLoss kRobustRefinement{Loss::cauchy, 2};

std::array<std::size_t, 3> draw_three(std::minstd_rand& random, std::size_t n) {
    std::array<std::size_t, 3> drawn{};
    for (std::size_t k = 0; k < 3;) {
        drawn[k] = random() % n;
        if (std::find(drawn.begin(), drawn.begin() + k, drawn[k]) == drawn.begin() + k) ++k;
    }
    return drawn;
}

/// Samples of three needed so that, with probability 1 - kProbabilityMissed, one has only inliers, for so many of
/// n.
double samples_needed(std::size_t inliers, std::size_t n) {
    const auto m = static_cast<double>(inliers), all = static_cast<double>(n);
    const double clean = m * (m - 1) * (m - 2) / (all * (all - 1) * (all - 2));
    if (clean >= 1) return 0;
    if (clean <= 0) return std::numeric_limits<double>::infinity();
    return std::log(kProbabilityMissed) / std::log1p(-clean);
}

}  // namespace

void PnpSolver::solve_with_outliers(const PnpInput& input) {
    all_.assign(input);
    if (!find_consensus()) {
        solution_.status = PnpStatus::no_consensus;
        return;
    }
    // Alternates between fitting the inliers and selecting them: settles within a few rounds.
    constexpr int kRounds = 5;
    Rigid3 T = consensus_.T;
    for (int round = 0; round < kRounds; ++round) {
        const std::vector<std::uint8_t>& before = solution_.inlier;
        const std::size_t inliers = mark_inliers(all_, T, flags_);
        const bool settled = round > 0 && std::equal(before.begin(), before.end(), flags_.begin());
        if (settled || inliers < kInliersMin) break;
        solution_.inlier.assign(flags_.begin(), flags_.begin() + static_cast<std::ptrdiff_t>(before.size()));
        solution_.inliers = inliers;
        points_.assign(input, solution_.inlier);
        refine(points_, T, {}, solution_.fit);
        T = solution_.fit.T_camera_body;
    }
    gather();
    const PointExtent spread = extent_of(gathered_);
    if (solution_.fit.ok()) consider_reversed(spread);
}

std::size_t PnpSolver::mark_inliers(const PnpPoints& points, const Rigid3& T, std::span<std::uint8_t> flags) {
    points.squared_residuals(points.centred(T), squared_);
    std::size_t inliers = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        flags[i] = squared_[i] < kInlierSquaredResidual ? 1 : 0;
        inliers += flags[i];
    }
    return inliers;
}

bool PnpSolver::find_consensus() {
    const std::size_t n = all_.size();
    std::minstd_rand random(1);
    consensus_ = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(), {}, 0};
    for (int tried = 0; tried < kHypothesesMax && tried < samples_needed(consensus_.inliers, n); ++tried) {
        std::array<BodyPoint, 3> sample;
        const auto drawn = draw_three(random, n);
        for (std::size_t k = 0; k < 3; ++k) sample[k] = {all_.centred_body_m(drawn[k]), all_.normalised(drawn[k])};
        const InitialPoses starts = three_point_poses(sample);
        for (std::size_t i = 0; i < starts.count; ++i) try_hypothesis(starts.pose[i]);
    }
    const auto enough = static_cast<std::size_t>(kInliersPart * static_cast<double>(n));
    return consensus_.inliers >= std::max(kInliersMin, enough);
}

void PnpSolver::try_hypothesis(const CentredPose& pose) {
    const double cost_of_sample = all_.truncated_cost(pose, kSampleSquaredResidual);
    if (!(cost_of_sample < consensus_.cost_of_sample)) return;
    consensus_.cost_of_sample = cost_of_sample;
    // Local optimisation (Chum, Matas and Kittler 2003): refines the best samples with all points that agree.
    refine(all_, all_.uncentred(pose), {{}, kRobustRefinement}, trial_);
    if (trial_.status != PnpStatus::converged) return;
    const double cost = all_.truncated_cost(all_.centred(trial_.T_camera_body), kInlierSquaredResidual);
    if (!(cost < consensus_.cost)) return;
    consensus_.cost = cost;
    consensus_.T = trial_.T_camera_body;
    consensus_.inliers = mark_inliers(all_, consensus_.T, flags_);
}

}  // namespace narpa
