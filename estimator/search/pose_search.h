/// estimator/search/pose_search.h - the pose of a target in a frame without a guess: any attitude, anywhere in the
/// image, at a range that is roughly known.
///
/// The camera's attitude is known, and so is the light in its axes; the target's attitude is not. Attitudes all
/// over SO(3) are rendered small and compared with the frame (template_matcher.h). The best are refined by steps of
/// attitude, then fitted to all pixels of a coarse image (dense/); those that remain likely are fitted to all
/// pixels of the frame. The answer is the pose with the smallest loss, tested like any dense answer; other poses
/// that explain the frame as well make it ambiguous.
#pragma once

#include <span>
#include <vector>

#include "estimator/dense/dense_alignment.h"

namespace narpa {

struct SearchOptions {
    double range_m = 0;       ///< to the target's origin, as far as it is known
    double range_part = 0.3;  ///< its relative uncertainty
    int attitudes = 4400;     ///< rendered at first: 15 degrees apart
    int kept = 48;            ///< of these, refined by steps of attitude
    int finished = 8;         ///< of these, fitted to all pixels of a coarse image
    int fewest_pixels = 40;   ///< refuses a frame in which fewer stand out against the background
    DenseOptions dense{};     ///< its T_world_camera is not used
};

struct SearchEstimate {
    Rigid3 T_camera_target{};
    Matrix6 covariance = Matrix6::Zero(), covariance_of_model = Matrix6::Zero();  ///< DenseEstimate's
    Answer answer;
    int templates = 0;   ///< small renders
    int renders = 0;     ///< images compared pixel by pixel
    int contenders = 0;  ///< poses that were fitted to all pixels of the frame
    std::size_t pixels = 0;
    double residual = 0;
};

class PoseSearch {
public:
    /// `render_scene` outlives it; `target`: index of the body whose pose is sought.
    PoseSearch(const RenderScene& render_scene, const Camera& camera, std::size_t target);

    /// `at`: poses of all bodies in the middle of the exposure, of which the target's is not used;
    /// `T_world_camera`: the camera's then. `frame_variance`: DenseAlignment. Deterministic; runs on the calling
    /// thread's TBB arena. Errors: sizes, options or a camera's pose that are unusable.
    [[nodiscard]] Result<SearchEstimate> find(const MeasuredImage& frame, const BodyPoses& at,
                                              const Rigid3& T_world_camera, const SearchOptions& options,
                                              std::span<const float> frame_variance = {});

    /// DenseAlignment::bound, with the light known in the camera's axes.
    [[nodiscard]] Result<Matrix6> bound(const BodyPoses& at, const Rigid3& T_world_camera,
                                        const Rigid3& T_camera_target, DenseOptions options,
                                        std::span<const float> frame_variance = {});

    /// Exposure and gain of the frames from now on.
    void set_detector(const Detector& detector);

private:
    struct Contender;
    struct SearchState;
    [[nodiscard]] std::vector<Contender> coarse_fits(const SearchState& sought, SearchEstimate& out);
    [[nodiscard]] Result<DenseEstimate> fine_fit(const SearchState& sought, const Contender& contender,
                                                 DenseOptions options, SearchEstimate& out);
    [[nodiscard]] Status fine_fits(const SearchState& sought, std::vector<Contender>& contenders,
                                   SearchEstimate& out);

    const RenderScene& render_scene_;
    Camera camera_;  ///< without an embedded line
    std::size_t target_;
    DenseAlignment dense_;
};

}  // namespace narpa
