/// estimator/features/feature_alignment.h - pose estimation by rendering the model and matching features.
///
/// The paper's section VI: render the model at the guess, match features of the rendered view with the frame,
/// intersect the features' rays with the model, solve PnP, and repeat from the new pose until the view stops
/// moving. The points on the body are exact: a ray through each feature, not a pixel of a depth map.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "estimator/features/feature_matcher.h"
#include "estimator/features/match_suspects.h"
#include "estimator/features/model_matches.h"
#include "estimator/pnp/pnp_refine.h"
#include "estimator/pnp/point_observations.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "estimator/view/model_view.h"

namespace narpa {

struct FeatureSettings {
    int features = 400;        ///< detected in the view, at most
    int renders_max = 10;      ///< views rendered for a frame
    double settled_px = 0.02;  ///< converged: a solution moves the points by less (RMS)
    int spp = 4;               ///< of the views
    int spp_over_time = 16;    ///< the same if rows are exposed over time: each sample sees one moment
    std::uint64_t seed = 0;    ///< of the views' samples: the same for all, so that they differ by the pose alone
    double floor_max_px = 1;   ///< refused if matches scatter by more: the frame does not show the model
    ModelUncertainty model{};  ///< albedo is not used, as views are scaled to the frame's light
};

enum class FeatureStatus : std::uint8_t {
    settled,
    unsettled,    ///< still moving after renders_max views
    few_matches,  ///< fewer than kFewestMatches inliers, or windows that all overlap
    no_pose,      ///< the solver failed
};
inline constexpr int kFewestMatches = 8;
[[nodiscard]] std::string_view name(FeatureStatus status) noexcept;

/// One view rendered and compared.
struct FeatureRound {
    double before_px = 0, after_px = 0;  ///< RMS distance of the inlier matches at the guess and at the solution
};

struct FeatureEstimate {
    FeatureStatus status = FeatureStatus::few_matches;
    Rigid3 T_camera_target{};
    /// From the sensor's noise and the excess scatter of the matches, both correlated between matches in proportion
    /// to the overlap of their windows, and enlarged where matches respond less to a motion than points on the body
    /// would; plus the distance between the answers of two starts, plus the model's uncertainty.
    Matrix6 covariance = Matrix6::Zero();
    Matrix6 covariance_of_model = Matrix6::Zero();  ///< part of the model's uncertainty, common to all frames
    /// Cramer-Rao for these points with the sensor's noise and the model's uncertainty alone.
    Matrix6 bound = Matrix6::Zero();
    int agreeing = 0;
    double floor_px = 0;                 ///< scatter of the matches beyond the sensor's noise
    std::vector<FeatureRound> rounds;    ///< from the guess
    Vector6 by_focal = Vector6::Zero();  ///< shift of the pose (pnp_refine.h)
    PoseShifts by_light{6, 0};           ///< by the light's direction, turned about each of the target's axes
    MatchSuspicion rows{};               ///< progressive_rows
    ModelMatches matches{};              ///< of the last view, those that agree
    Answer answer;
    PointObservations points{};  ///< `matches`, as a batch takes them

    [[nodiscard]] bool has_pose() const noexcept {
        return status == FeatureStatus::settled || status == FeatureStatus::unsettled;
    }
};

/// Reuses its memory from frame to frame.
class FeatureAlignment {
public:
    /// `render_scene` outlives it. `target`: index of the body. `at`: as for ModelView.
    FeatureAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at,
                     const FeatureSettings& settings = {});

    /// `at`: poses of the bodies in the middle of the exposure; `motion`: the target's during it, in camera axes,
    /// for cameras with a shutter. Wrong matches (occlusion, other illumination) are rejected as outliers. Runs on
    /// the calling thread's TBB arena.
    [[nodiscard]] FeatureEstimate align(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                                        const ApparentMotion& motion = {});
    /// Exposure and gain of the frames from now on.
    void set_detector(const Detector& detector);

private:
    [[nodiscard]] FeatureEstimate estimate(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                                           const ApparentMotion& motion);
    /// Matches features on the target in the last rendered view with the frame. `gain`: ratio of the frame's light
    /// to the view's, as found in the previous view. `is_near`, result: as of match_corners.
    bool gather(const MeasuredImage& frame, const ByteImage& frame_bytes, const ByteScale& scale, bool is_near,
                double& gain, ModelMatches& points);
    void find_target();
    /// Ratio of the frame's light to the view's about these matches: median over their windows; 1 without any.
    [[nodiscard]] double gain_about(const std::vector<FeatureMatch>& matches, const MeasuredImage& frame) const;
    [[nodiscard]] Matrix6 response(const ModelMatches& points, const ByteScale& scale,
                                   const FrameSettings& settings, const Rigid3& T_camera_target,
                                   const Matrix6& covariance, double floor_px);
    /// Shifts of the pose that matches show when the light is rotated by its uncertainty, for the view at this
    /// pose.
    [[nodiscard]] PoseShifts shifts_by_light(const ModelMatches& points, const ByteScale& scale,
                                             const FrameSettings& settings, const Rigid3& T_camera_target,
                                             const BodyPoses& at, const ApparentMotion& motion, double floor_px);
    void compare_with_mirrored(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                               const ApparentMotion& motion, FeatureEstimate& e, Fit& fit);
    void keep_guess_where_unobserved(const Rigid3& guess, FeatureEstimate& e, Fit& fit);
    [[nodiscard]] bool on_smooth_surface(const HitBatch& hits) const;

    ModelView view_;
    SensorModel sensor_;
    RowTimes times_;
    FeatureSettings settings_;
    std::vector<std::uint8_t> on_target_;  ///< of each pixel of the view
};

}  // namespace narpa
