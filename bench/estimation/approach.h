/// bench/estimation/approach.h - poses from single frames along an approach: success rate from a poor guess, error,
/// time; and how large an error of the guess each method tolerates.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/stop.h"
#include "emulator/threads.h"
#include "estimator/view/measured_image.h"
#include "estimator/view/model_view.h"
#include "tracking/frame_tracker.h"

namespace narpa {

struct ApproachOptions {
    std::span<const CameraMethod> methods = camera_methods();
    int frames = 200;
    double from_m = 100, to_m = 1.2;  ///< range, target's origin to camera; in equal steps of its logarithm
    Vec3 along{1, 0, 0};              ///< from the target towards the camera, target axes
    Vec3 up{0, 0, 1};                 ///< up in the image, target axes
    double start_deg = 5, start_percent = 5;
    int frame_spp = 16;                               ///< of the frames that are estimated from
    std::vector<double> basin{2, 5, 10, 15, 20, 30};  ///< errors of the starts, degrees and per cent; empty: none
    int basin_trials = 10;
    double basin_range_m = 20;
    std::uint64_t seed = 1;
    /// For cameras with a shutter: rate at which the camera turns and speed at which it passes the target, in a
    /// random direction for each frame.
    double turn_rad_s = 0, speed_m_s = 0;
    std::vector<std::string>
        ignored;  ///< kIgnorable: what the estimators do not know of the camera; rows: the rolling of its shutter
};
/// Words of ApproachOptions::ignored.
inline constexpr std::array<std::string_view, 4> kIgnorable{"distortion", "rows", "shutter", "psf"};

struct ApproachFrame {
    double range_m = 0;
    bool found = false;                       ///< claimed, and both errors are below a fifth of the start's
    bool claimed = false;                     ///< by the method
    std::string why;                          ///< why the pose is not claimed, or not in all motions
    double rotation_rad = 0, position_m = 0;  ///< errors
    double bound_rotation_rad = 0, bound_position_m = 0;  ///< roots of the summed variances of the bound
    double nees = 0;                                      ///< of the observed motions,
    int observed = 6;                                     ///< and their number
    double ms = 0;
    int renders = 0;
};

/// Over the frames of a range band.
struct ApproachBand {
    double from_m = 0, to_m = 0;
    int frames = 0, found = 0;
    int wrong = 0;  ///< claimed, and beyond their covariance: kSixSigmaNees
    double rotation_rms_rad = 0, position_rms_m = 0;
    double rotation_of_bound = 0, position_of_bound = 0;  ///< RMS of error over bound
    double nees_median = 0;  ///< of poses with all motions observed; 5.35 for a consistent estimator
    double ms_median = 0, renders_mean = 0;
};

struct BasinCell {
    double off_deg_and_percent = 0;
    int trials = 0, found = 0;
};

struct ApproachRun {
    const CameraMethod* method = nullptr;
    std::vector<ApproachFrame> frames;
    std::vector<ApproachBand> bands;  ///< the last is over all frames
    std::vector<BasinCell> basin;
};

/// A frame of the approach as the camera exposes it, with its true pose.
struct ApproachView {
    Rigid3 truth{};           ///< T_camera_target
    ApparentMotion motion{};  ///< in camera axes
    BodyPoses at;             ///< of every body
    MeasuredImage image;
    std::vector<float> variance_dn2;  ///< of the Monte Carlo noise, which no real sensor has
};

class ApproachFrames {
public:
    ApproachFrames(const World& world, const Camera& camera, std::size_t target, const ApproachOptions& options);

    /// Frame k of n.
    const ApproachView& make(int k, int n);
    /// At this range, with the noise and the offsets of this number.
    const ApproachView& make_at(double range_m, std::uint32_t number);

private:
    [[nodiscard]] Rigid3 pose(double range_m, std::uint32_t number) const;
    [[nodiscard]] ApparentMotion motion(std::uint32_t number) const;

    const ApproachOptions& options_;
    Camera camera_;
    BodyPoses at_;
    SensorModel sensor_;
    ModelView view_;
    std::vector<std::uint8_t> bytes_;
    ApproachView made_;
};

/// `target` and the camera are of the world's scene, placed as the approach goes; other bodies stay where the scene
/// has them at time 0. `progress` is called with each step. Returns the results so far once `stop` is
/// set.
[[nodiscard]] std::vector<ApproachRun> run_approach(const World& world, std::size_t camera, std::size_t target,
                                                    const ApproachOptions& options, TracingThreads& threads,
                                                    const std::function<void(const std::string&)>& progress,
                                                    const StopFlag& stop);

[[nodiscard]] nlohmann::json to_json(const std::vector<ApproachRun>& runs);
/// A table as text.
[[nodiscard]] std::string to_text(const std::vector<ApproachRun>& runs);
/// Plots (plot/plot.h) five frames of the approach, the renders at the poses that the points lead to, and the
/// distances of the matches before and after each solution (a figure of the paper).
[[nodiscard]] Status plot_approach_frames(const std::string& path, const World& world, std::size_t camera,
                                          std::size_t target, const ApproachOptions& options,
                                          TracingThreads& threads);

}  // namespace narpa
