/// estimator/method/camera_method.h - the methods that find a target's pose in a camera's frame near a guess: a
/// table with one row each.
///
/// The command line, scenarios, their help and error texts, trackers and benches know the methods by this table.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"
#include "estimator/pnp/point_observations.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "estimator/view/measured_image.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// Each method uses what it needs.
struct FrameEstimatorSettings {
    std::uint64_t seed = 0;  ///< of the samples of its renders
    int spp = 4;             ///< of renders of which points are matched
    /// Guesses are a filter's predictions, usually so close that one render of which points are matched is enough.
    bool guesses_are_predictions = false;
    /// Methods that need a better guess than points do start from the pose that points give, where there is one.
    bool starts_from_features = false;
    ModelUncertainty model{};
};

/// A frame and what is known about it.
struct FrameInput {
    const MeasuredImage& image;
    const BodyPoses& at;      ///< poses of all bodies in mid-exposure; the target's gives its illumination
    Rigid3 guess{};           ///< T_camera_target
    ApparentMotion motion{};  ///< the target's during the exposure, camera axes
    /// The camera's, if the light is known in its axes (DenseOptions::T_world_camera).
    std::optional<Rigid3> T_world_camera{};
    std::span<const float> variance{};  ///< DN^2 of each pixel beside the sensor's noise; empty: not known
    int coarsest = 16;  ///< sensor pixels per pixel of the coarsest image that the guess needs, each way
    std::uint64_t seed_offset = 0;  ///< added to the seed, where sampling noise should differ between frames
};

struct FramePose {
    Rigid3 T_camera_target{};
    Matrix6 covariance = Matrix6::Zero();           ///< pose_estimate.h
    Matrix6 covariance_of_model = Matrix6::Zero();  ///< part of the model's uncertainty
    Answer answer;
    int measurements = 0;  ///< points or pixels used
    int renders = 0;
};

/// One method, made for one camera and one target. Runs on the calling thread's TBB arena.
class FrameEstimator {
public:
    virtual ~FrameEstimator() = default;
    /// Errors: sizes or a guess that are unusable.
    [[nodiscard]] virtual Result<FramePose> estimate(const FrameInput& frame) = 0;
    /// Cramer-Rao bound of the measurements that the method takes from a frame, at this pose; of the frame
    /// estimated last, where the method's measurements depend on the frame.
    [[nodiscard]] virtual Result<Matrix6> bound(const FrameInput& frame, const Rigid3& T_camera_target) = 0;
    /// Points that the pose of the frame estimated last rests on; null: the method finds no points.
    [[nodiscard]] virtual const PointObservations* points() const noexcept { return nullptr; }
    /// Exposure and gain of the frames from now on.
    virtual void set_detector(const Detector& detector) = 0;
};

struct CameraMethod {
    std::string_view name;      ///< `--method`, `camera_method` of a scenario, `method` in results
    std::string_view measures;  ///< what it compares
    std::string_view help;
    /// Compares pixels, so that the frame's noise decides whether the model fits (FrameInput::variance).
    bool takes_frame_noise = false;
    bool finds_points = false;  ///< FrameEstimator::points, for estimates of many frames at once
    /// Renders with the light that the guess's attitude implies, not with that of the pose it finds.
    bool light_is_that_of_the_guess = false;
    /// Factor on the variance of an error for filters, which take errors of consecutive frames as independent.
    double variance_between_frames = 1;
    /// An Error where the method cannot use a target; null: it can use any.
    Status (*needs)(const Scene& scene, std::size_t target) = nullptr;
    /// `render_scene` outlives the estimator. `target`: index of the body.
    std::unique_ptr<FrameEstimator> (*make)(const RenderScene& render_scene, const Camera& camera,
                                            std::size_t target, const FrameEstimatorSettings& settings);
};

/// The first is the default.
[[nodiscard]] std::span<const CameraMethod> camera_methods() noexcept;
/// An Error where the method cannot estimate this body's pose.
[[nodiscard]] Status check_method(const CameraMethod& method, const Scene& scene, std::size_t target);
/// Null where there is none of this name.
[[nodiscard]] const CameraMethod* find_camera_method(std::string_view name) noexcept;
/// "NAME: HELP; NAME: HELP".
[[nodiscard]] std::string help_of_camera_methods();
/// Names of the methods that take the frame's noise, separated by " or ".
[[nodiscard]] std::string camera_methods_that_take_noise();
/// The same of those that find points.
[[nodiscard]] std::string camera_methods_that_find_points();

}  // namespace narpa
