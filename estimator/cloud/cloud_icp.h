/// estimator/cloud/cloud_icp.h - the pose of a target from a LiDAR's sweep: point-to-plane ICP against its model.
///
/// Each beam is traced into the model at the current pose; the hit is the correspondence, and the measured point
/// should lie on the tangent plane there (Y. Chen, G. Medioni, "Object modelling by registration of multiple range
/// images", 1992; correspondences along the line of sight: G. Blais, M. Levine, 1995). Solved by robustly weighted
/// Gauss-Newton: first on few points, with correspondences searched around each beam within decreasing radii; then
/// on all points, along their beams. Unobservable motions keep their start value and are reported
/// (observability.h): what the search has moved along them is undone.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "estimator/cloud/beam_association.h"
#include "estimator/cloud/empty_beams.h"
#include "estimator/cloud/plane_equations.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/leverage.h"
#include "estimator/uncertainty/model_uncertainty.h"

namespace narpa {

/// With fewer points on the target there is no pose.
inline constexpr std::size_t kFewestSweepPoints = 6;

struct IcpSettings {
    RangeNoise noise{};
    CertainReturn certain{};  ///< for beams without return; default: these are ignored
    int iterations = 50;      ///< at most, after the search
    double settled = 0.05;  ///< converged: a step shorter than this, in standard deviations; 0: run all iterations
    /// Least share of points on the model at a correct pose, tested at 95 % confidence: a smaller share means a
    /// false minimum, or too few points to decide (29 points, all on the model, suffice for 0.9). The search is
    /// then repeated with four times as many points.
    double min_inlier_share = 0.9;
    ModelUncertainty model{};
};

struct CloudEstimate {
    Rigid3 T_lidar_target{};
    /// Covariance of the pose's error (pose_estimate.h): of the robust estimate (P. Huber, Robust Statistics, 1981,
    /// section 7.6), scaled by the residuals' own scatter or the configured noise, whichever is larger, plus that
    /// of the model's uncertainty. Along unobserved motions that of the guess.
    Matrix6 covariance = Matrix6::Zero();
    Matrix6 covariance_of_model = Matrix6::Zero();  ///< part of the model's uncertainty, common to all sweeps
    /// Root of the inverse covariance, for filters: zero rows for unobserved motions (root_information.h).
    Matrix6 root_information = Matrix6::Zero();
    /// Cramer-Rao bound of the points used at the configured noise, plus the model's uncertainty.
    Matrix6 bound = Matrix6::Zero();
    Observability observability{};
    double scale = 0;       ///< relative excess of the target's size over its model's, with ModelUncertainty::scale
    int iterations = 0;     ///< including those of the search
    bool settled = false;   ///< the last step was small
    bool on_model = false;  ///< the share of explained points is sufficient
    /// Other poses that explain the points nearly as well: a near symmetry of the model, or few points.
    std::vector<Rival> rivals;
    Answer answer;
    /// points is the sum of the others.
    std::size_t points = 0, used = 0, missed = 0, edges = 0, grazing = 0, rejected = 0;
    /// Number of used points that contribute to the pose but not to its covariance. Either they hold one or two
    /// motions alone, so that an error would not show (leverage.h); or a motion rests on points that may lie on
    /// another surface within two standard deviations of the range.
    int unchecked = 0;
    /// Points within four standard deviations of the noise from the model.
    std::size_t explained = 0;
    EmptyBeamCount empty_beams;
    /// Negative log-likelihood for normal noise with outliers beyond four standard deviations: half the sum of the
    /// points' squared distances in standard deviations, at most 8 each.
    double cost = 0;
    double radius_m = 0;  ///< RMS distance of the points used from their centre
};

/// Search radius of CloudIcp::align for a guess with these standard deviations: four of them. 0, no search, below
/// 0.3 m: a search costs much more than an alignment. `reach_m`: bounding radius of the target about its origin.
[[nodiscard]] double search_radius_m(double position_sigma_m, double rotation_sigma_rad, double reach_m);

class CloudIcp {
public:
    /// `tracer` outlives it. `target`: index of the body whose pose is estimated.
    CloudIcp(const Tracer& tracer, std::size_t target, const IcpSettings& settings = {})
        : settings_(settings),
          association_(tracer, target),
          empty_beams_(tracer, target, settings.noise, settings.certain) {}

    /// `search_m`: bound of the initial error of surface positions, about distance * angle + shift; 0: no search
    /// around the beams. Refuses an answer if fewer than six beams meet the model, or if it is fully observed but
    /// further from the start than 2.5 times `search_m`, or refuted by the sweep's beams without return, `empty`.
    /// `start_covariance`: of the start's error, kept along motions that the sweep does not observe. Errors:
    /// non-finite input, a range that is not positive, or a direction that is not of unit length. Allocates only
    /// when the sweep has more points than all before, or for an Error.
    [[nodiscard]] Result<CloudEstimate> align(std::span<const RangePoint> points, const ApparentMotion& motion,
                                              const Rigid3& start, double search_m = 0,
                                              std::span<const EmptyBeam> empty = {},
                                              const std::optional<Matrix6>& start_covariance = {});

    /// For searches: the pose to which few points lead from an attitude, with search radii that start at
    /// `search_m`, and its cost (CloudEstimate::cost). The target is first shifted so that its surface is centred
    /// on the points.
    struct Approach {
        Rigid3 T_lidar_target{};
        double cost = 0;
    };
    /// Uses the sweep given to align() or begin() last.
    [[nodiscard]] Approach approach(const Rigid3& start, double search_m);
    /// Checks and sets the sweep; the spans outlive its use.
    [[nodiscard]] Status begin(std::span<const RangePoint> points, const ApparentMotion& motion,
                               std::span<const EmptyBeam> empty = {});

private:
    [[nodiscard]] Answer answer_of(const CloudEstimate& found, const Rigid3& start, double search_m) const;
    void set_covariance(const PlaneEquations& equations, const Matrix6& information, CloudEstimate& out) const;
    void leave_out_unchecked_points(const Rigid3& start, CloudEstimate& out);
    [[nodiscard]] CheckedInformation check_points(const PlaneEquations& equations, const Rigid3& T);
    [[nodiscard]] Vector6 step_of_checked(const CheckedInformation& checked) const;
    void return_to_start(CloudEstimate& found, const Rigid3& start);
    /// Normal equations at this pose; empty if too few points meet the model.
    [[nodiscard]] std::optional<PlaneEquations> linearise(const Rigid3& T, double search_m, std::size_t stride,
                                                          CloudEstimate& out);
    [[nodiscard]] CloudEstimate attempt(const Rigid3& start, double search_m, std::size_t points, int radii);
    [[nodiscard]] Eigen::RowVector3d common_errors_m(const RangePoint& p) const;
    [[nodiscard]] double edges_hold_m() const;
    void refit_missed_beams(CloudEstimate& found);
    [[nodiscard]] static bool may_have_rivals(const CloudEstimate& e);
    bool search_rivals(CloudEstimate& found, double search_m);
    [[nodiscard]] Rigid3 search(const Rigid3& start, double search_m, std::size_t points, int radii,
                                CloudEstimate& out);

    IcpSettings settings_;
    std::optional<Matrix6> start_covariance_;
    BeamAssociation association_;
    EmptyBeams empty_beams_;
    ApparentMotion motion_{};  ///< of the sweep
    std::span<const RangePoint> points_;
    bool have_common_errors_ = false;  ///< RangePoint::common_m
    std::vector<PointToPlane> planes_;
    std::vector<WeightedRow> rows_;  ///< of the points used
    std::vector<WeightedRow> checked_rows_;
    std::vector<double> magnitudes_;
};

}  // namespace narpa
