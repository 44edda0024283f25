/// estimator/cloud/cloud_icp.h - the pose of a target from a LiDAR's sweep: point-to-plane ICP against its model.
///
/// Each beam is traced into the model at the current pose; the hit is the correspondence, and the measured point
/// should lie on the tangent plane there (Y. Chen, G. Medioni, "Object modelling by registration of multiple range
/// images", 1992; correspondences along the line of sight: G. Blais, M. Levine, 1995). Robustly weighted
/// Gauss-Newton: first on few points with correspondences searched around each beam, within decreasing radii; then
/// on all along their beams. Unobservable motions stay as in the start and are reported (observability.h).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "estimator/cloud/beam_association.h"
#include "estimator/cloud/empty_beams.h"
#include "estimator/cloud/plane_equations.h"
#include "estimator/pose/answer.h"
#include "estimator/pose/leverage.h"
#include "estimator/pose/model_uncertainty.h"

namespace narpa {

struct IcpSettings {
    RangeNoise noise{};
    CertainReturn certain{};  ///< for beams without return; nowhere: they are not looked at
    int iterations = 50;      ///< at most, after the search
    double settled = 0.05;    ///< converged: a step of fewer standard deviations; 0: all iterations
    /// Least part of the points on the model at a right pose, with a confidence of 95 %: fewer mean a false
    /// minimum, or too few points to tell (29, all on the model, are enough for 0.9). The search is then repeated
    /// with four times the points.
    double explained_least = 0.9;
    ModelUncertainty model{};
};

struct CloudEstimate {
    Rigid3 T_lidar_target{};
    /// Of the pose's error (pose_estimate.h): of the robust estimate (P. Huber, Robust Statistics, 1981,
    /// section 7.6), for the residuals' own scatter, at least that of the noise, and of the model's uncertainty.
    Matrix6 covariance = Matrix6::Zero();
    Matrix6 covariance_of_model = Matrix6::Zero();  ///< the last part, which is the same in all sweeps
    /// Of the covariance, for filters: rows of zeros for motions that are not observed (root_information.h).
    Matrix6 root_information = Matrix6::Zero();
    /// Cramer-Rao bound for the points used and the noise of the settings, and the model's uncertainty.
    Matrix6 bound = Matrix6::Zero();
    Observability observability{};
    double scale = 0;      ///< by this part the target is larger than its model, if ModelUncertainty::scale is told
    int iterations = 0;    ///< with those of the search
    bool settled = false;  ///< the last step was small
    bool on_model = false;  ///< enough points are explained
    /// Other poses that explain the points nearly as well: a near symmetry of the model, or few points.
    std::vector<Rival> rivals;
    Answer answer;
    /// The first is the sum of the others.
    std::size_t points = 0, used = 0, missed = 0, edges = 0, grazing = 0, rejected = 0;
    /// Of the points used: they count for the pose, not for what it is worth. They hold a motion alone, or two of
    /// them, so that an error would not show (leverage.h); or a motion rests on points that may lie on another
    /// surface, which begins within two standard deviations of the range.
    int unchecked = 0;
    /// Points within four standard deviations of the noise from the model.
    std::size_t explained = 0;
    EmptyBeamCount empty_beams;
    /// Minus the logarithm of the likelihood, of normal noise and outliers beyond four standard deviations: half
    /// the sum of the points' squared distances in standard deviations, at most 8 each.
    double cost = 0;
    double radius_m = 0;  ///< of the points used about their centre, root mean square
};

class CloudIcp {
public:
    /// `tracer` outlives it. `target`: index of the body whose pose is estimated.
    CloudIcp(const Tracer& tracer, std::size_t target, const IcpSettings& settings = {})
        : settings_(settings),
          association_(tracer, target),
          empty_beams_(tracer, target, settings.noise, settings.certain) {}

    /// `search_m`: bound of the error of surfaces at the start, about distance * angle + shift; 0: no search around
    /// the beams. An answer that is observed in all motions and further from the start than 2.5 times that is
    /// refused, and one that `empty`, the sweep's beams without return, refute. Errors: a point that is not finite
    /// or not a range along a unit direction, a motion, a start or a search that is not finite, or fewer than six
    /// beams that meet the model. Allocates only for more points than ever before, or an Error.
    [[nodiscard]] Result<CloudEstimate> align(std::span<const RangePoint> points, const ApparentMotion& motion,
                                              const Rigid3& start, double search_m = 0,
                                              std::span<const EmptyBeam> empty = {});

    /// For searches: where few points lead from an attitude, within circles that begin with `search_m`, and what
    /// they cost there (CloudEstimate::cost). The target is first moved to where its surface is as the points'.
    struct Approach {
        Rigid3 T_lidar_target{};
        double cost = 0;
    };
    /// Of the sweep that align() or begin() had last.
    [[nodiscard]] Approach approach(const Rigid3& start, double search_m);
    /// Checks and sets the sweep; the spans outlive its use.
    [[nodiscard]] Status begin(std::span<const RangePoint> points, const ApparentMotion& motion,
                               std::span<const EmptyBeam> empty = {});

private:
    [[nodiscard]] Answer answer_of(const CloudEstimate& found, const Rigid3& start, double search_m) const;
    void weigh(const PlaneEquations& equations, const Matrix6& information, CloudEstimate& out) const;
    void verify(CloudEstimate& out);
    /// At this pose; nothing where too few points meet the model to solve for one.
    [[nodiscard]] std::optional<PlaneEquations> linearise(const Rigid3& T, double search_m, std::size_t stride,
                                                          CloudEstimate& out);
    [[nodiscard]] CloudEstimate attempt(const Rigid3& start, double search_m, std::size_t points, int circles);
    [[nodiscard]] double edges_hold_m() const;
    void draw_in(CloudEstimate& found);
    [[nodiscard]] static bool may_have_rivals(const CloudEstimate& e);
    bool compete(CloudEstimate& found, double search_m);
    [[nodiscard]] Rigid3 search(const Rigid3& start, double search_m, std::size_t points, int circles,
                                CloudEstimate& out);

    IcpSettings settings_;
    BeamAssociation association_;
    EmptyBeams empty_beams_;
    ApparentMotion motion_{};  ///< of the sweep
    std::span<const RangePoint> points_;
    std::vector<PointToPlane> planes_;
    std::vector<WeightedRow> rows_;  ///< of the points used
    std::vector<double> magnitudes_;
};

}  // namespace narpa
