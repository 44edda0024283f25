/// estimator/pnp/pnp.h - perspective-n-point: the pose from correspondences, without a guess, optionally with
/// outliers.
///
/// An initial pose (pnp_start.h) is refined (pnp_refine.h); one by SQPNP too where the fit is worse than the noise
/// allows. The second pose of a nearly flat or distant body is always searched for, and reported where the data
/// cannot exclude it.
#pragma once

#include <vector>

#include "estimator/pnp/pnp_refine.h"
#include "estimator/pnp/pnp_start.h"
#include "estimator/uncertainty/answer.h"

namespace narpa {

inline constexpr double kAmbiguousChi2 = 9;  ///< three standard deviations
/// A sum of squares this many of its standard deviations above its mean is not due to noise.
inline constexpr double kMaxChi2Sigmas = 5;
inline constexpr double kImpreciseSigma = 0.01;         ///< of the range
inline constexpr double kInlierSquaredResidual = 13.8;  ///< 99.9 % of chi-square with two degrees of freedom

struct PnpSolution {
    PnpStatus status = PnpStatus::no_convergence;
    PnpFit fit;  ///< of the least chi2, from the inliers alone
    /// Another minimum with all points in front of the camera, if one was found.
    bool has_second = false;
    PnpFit second;
    bool imprecise = false;  ///< position sigma above 1 % of the range: near a danger cylinder, or too far
    std::vector<std::uint8_t> inlier;  ///< for each point: 1 if the fit used it
    std::size_t inliers = 0;

    [[nodiscard]] bool ok() const noexcept { return status == PnpStatus::converged; }
    /// True if the second pose may be the true one: its chi2 is less than 9 above the first's.
    [[nodiscard]] bool ambiguous() const noexcept { return has_second && second.chi2 - fit.chi2 < kAmbiguousChi2; }
    /// Classifies the pose by chi2 at the given noise, the second pose and the observability (answer.h).
    [[nodiscard]] Answer answer() const;
};

/// True if chi2 with this many degrees of freedom is consistent with noise.
[[nodiscard]] bool fits_the_noise(double chi2, double degrees_of_freedom) noexcept;

class PnpSolver {
public:
    explicit PnpSolver(std::size_t points_max);

    /// At least four points. `outliers`: some pixels may belong to other points: RANSAC first (Fischler and Bolles
    /// 1981). The solution stays valid until the next call. Allocates only where OpenCV is used.
    const PnpSolution& solve(const PnpInput& input, bool outliers = false);

private:
    void solve_all(const PnpInput& input, const PointExtent& spread);
    void solve_with_outliers(const PnpInput& input);
    void gather();
    void consider(const CentredPose& start);
    void consider_reversed(const PointExtent& spread);
    [[nodiscard]] std::size_t mark_inliers(const PnpPoints& points, const Rigid3& T, std::span<std::uint8_t> flags);
    [[nodiscard]] bool find_consensus();
    void try_hypothesis(const CentredPose& pose);

    PnpPoints points_, all_;  // those in use, and with outliers
    std::vector<BodyPoint> gathered_;
    std::vector<double> squared_;
    std::vector<std::uint8_t> flags_;
    PnpFit trial_;
    struct Consensus {
        double cost_of_sample = 0;  // of the best sample, before refinement
        double cost = 0;            // of the best pose
        Rigid3 T{};
        std::size_t inliers = 0;
    } consensus_;
    PnpSolution solution_;
};

}  // namespace narpa
