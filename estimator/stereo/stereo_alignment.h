/// estimator/stereo/stereo_alignment.h - the pose of a target from two frames of known relative pose.
///
/// Corners of the left frame are matched in the right one (stereo_matcher.h). As the left pixel is exact, each
/// triangulated point is a range along the left pixel's ray, with a standard deviation that grows with the square
/// of the range: a beam. Point-to-plane ICP aligns these beams to the target's mesh (cloud/cloud_icp.h).
#pragma once

#include "estimator/cloud/cloud_icp.h"
#include "estimator/stereo/stereo_matcher.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

struct StereoAlignmentSettings {
    int points_max = 500;  ///< matches used
    ModelUncertainty model{};
};

struct StereoEstimate {
    CloudEstimate pose;  ///< T_lidar_target is the target in the left camera's frame
    StereoPoints matches;
};

/// The settings with which points of a target are searched: within a sphere about it.
[[nodiscard]] StereoSettings stereo_settings_near(const StereoSphere& target);

/// Matches as ranges from the left camera. Errors that they have in common: one of all matches along the epipolar
/// line (kStereoBias_px, and the cameras' boresight_rad), and that of the focal length.
[[nodiscard]] std::vector<RangePoint> range_points_of(const StereoPoints& matches, const StereoPair& pair,
                                                      const ModelUncertainty& model);

class StereoAlignment {
public:
    /// `tracer` outlives it. `target`: index of the body whose pose is estimated.
    StereoAlignment(const Tracer& tracer, std::size_t target, const StereoAlignmentSettings& settings = {})
        : tracer_(tracer), target_(target), settings_(settings) {}

    /// `guess`, the target in the left camera's frame, is wrong by at most `search_m` at the target's surface.
    /// Answers as CloudIcp::align, whose `start_covariance` it takes. Errors: as match_stereo; a pose that is not
    /// finite.
    [[nodiscard]] Result<StereoEstimate> align(const StereoPair& pair, const MeasuredImage& left,
                                               const MeasuredImage& right, const Rigid3& guess, double search_m,
                                               const std::optional<Matrix6>& start_covariance = {}) const;

private:
    const Tracer& tracer_;
    std::size_t target_;
    StereoAlignmentSettings settings_;
};

}  // namespace narpa
