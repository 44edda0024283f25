/// estimator/cloud/cloud_icp.h - the pose of a target from a LiDAR's sweep: point-to-plane ICP against its model.
///
/// Each beam is cast into the model at the current pose; where it meets the surface is the point's partner, the
/// tangent plane there is what the measured point should lie on (Y. Chen, G. Medioni, "Object modelling by
/// registration of multiple range images", 1992; partners along the line of sight: G. Blais, M. Levine, 1995).
/// Gauss-Newton on robust weights: first of few points, partners looked for around each beam, in ever smaller
/// circles; then of all along their beams. Motions that the points do not tell are left as the start has them, and
/// reported (observability.h).
#pragma once

#include <span>
#include <vector>

#include "base/result.h"
#include "estimator/cloud/beam_association.h"
#include "estimator/cloud/observability.h"

namespace narpa {

struct IcpSettings {
    RangeNoise noise{};
    std::size_t search_points = 100;  ///< of the sweep, about so many are searched for
    int search_iterations = 10;       ///< circles of the search
    int iterations = 50;              ///< at most, after the search
    double grazing_cosine = 0.05;     ///< beams that meet a surface flatter than this do not count
    double unobserved_below = 1e-3;   ///< normalised eigenvalue (observability.h)
    double settled = 0.05;            ///< a step of so many standard deviations is the last; 0: take all iterations
    /// Of the points, so many lie on the model where the pose is right: with fewer, what else stands in the LiDAR's
    /// view apart, it is a false minimum. A search that ends in one is done again with four times the points.
    double explained_least = 0.9;
};
/// An Error names the setting, what it is and what was expected.
[[nodiscard]] Status check(const IcpSettings& settings);

struct CloudEstimate {
    Rigid3 T_lidar_target{};
    /// Of the pose's error (pose_estimate.h): of the robust estimate as it is (P. Huber, Robust Statistics, 1981,
    /// section 7.6), for the scatter that the residuals show, at least that of the noise.
    Matrix6 covariance = Matrix6::Zero();
    /// Cramer-Rao: the least covariance there can be for the points that were used, with the noise as it is set.
    Matrix6 bound = Matrix6::Zero();
    Observability observability{};
    int iterations = 0;     ///< with those of the search
    bool settled = false;   ///< the last step was small
    bool credible = false;  ///< settled, and enough points are explained
    double scatter = 0;     ///< of the residuals, in standard deviations of the noise: 1 where all is as set
    double residual_m = 0;  ///< RMS of the distances of the points used from their planes
    std::size_t points = 0, used = 0, missed = 0, grazing = 0, rejected = 0;  ///< sum: points = the rest
    /// Of the points, those that lie where the model has them, within four standard deviations of the noise.
    std::size_t explained = 0;
};

class CloudIcp {
public:
    /// `tracer` outlives it. `target`: index of the body whose pose is looked for. Errors: no such body, settings.
    static Result<CloudIcp> create(const Tracer& tracer, std::size_t target, const IcpSettings& settings);

    /// `search_m`: how far surfaces may lie off at the start, some distance * angle + shift; 0: no search around
    /// the beams. Errors: a point that is not finite or not a range along a unit direction, a motion, a start or a
    /// search that is not finite, or fewer than six beams that meet the model. Allocates only for more points than
    /// ever before, or an Error.
    [[nodiscard]] Result<CloudEstimate> align(std::span<const RangePoint> points, const SweepMotion& motion,
                                              const Rigid3& start, double search_m = 0);

private:
    CloudIcp(const Tracer& tracer, std::size_t target, const IcpSettings& settings)
        : settings_(settings), association_(tracer, target) {}
    struct Pass;  ///< sums over the points at one pose
    [[nodiscard]] static double variance_factor(const Pass& pass, std::size_t used);
    [[nodiscard]] Pass look(const Rigid3& T, double search_m, std::size_t stride, CloudEstimate& out);
    [[nodiscard]] CloudEstimate attempt(const Rigid3& start, double search_m, std::size_t points, int circles);
    [[nodiscard]] Rigid3 search(const Rigid3& start, double search_m, std::size_t points, int circles,
                                CloudEstimate& out);

    IcpSettings settings_;
    BeamAssociation association_;
    std::vector<PointToPlane> planes_;
    std::vector<double> magnitudes_;
};

}  // namespace narpa
