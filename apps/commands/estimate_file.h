/// apps/commands/estimate_file.h - `narpa estimate SCENE`: the pose from one frame, one pair of frames or one sweep
/// in files.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/cli.h"
#include "apps/scene_options.h"
#include "emulator/world.h"
#include "tracking/single_estimate.h"

namespace narpa::cli {

/// Scene, trajectory and --pose give the truth, or with `no_truth` the initial guess. Without `no_truth`, the guess
/// is the truth displaced.
struct FileEstimate {
    std::string scene;
    std::vector<std::string> sets;
    std::string sensor;               ///< name of the camera or LiDAR; empty: the first
    std::vector<std::string> frames;  ///< images or FILE.raw: one, or two of a stereo pair
    std::string sweep;                ///< FILE.pcap
    double time_s = 0;
    std::string unit;       ///< of the sweep's capture; empty: it holds packets of one
    bool no_truth = false;  ///< the poses are a guess
    PoseOptions pose;
    int threads = 0;
};

[[nodiscard]] Outcome estimate_frame(const FileEstimate& file, const TrackerOptions& options);
[[nodiscard]] Outcome estimate_sweep(const FileEstimate& file, const TrackerOptions& options);

/// The world between two times, as the scene and the poses have it.
[[nodiscard]] Result<std::unique_ptr<World>> world_of(const FileEstimate& file, std::int64_t t_ns,
                                                      std::int64_t until_ns);
/// The frame's bytes in the camera's format. Errors: a file that is not one of this camera.
[[nodiscard]] Result<std::vector<std::uint8_t>> frame_of(const std::string& path, const Camera& camera);

/// Prints an estimate beside the truth or the guess. Returns the document; `passed` if the pose is usable.
[[nodiscard]] nlohmann::json show(const EstimatedPose& of, const Rigid3& T, const Matrix6& covariance,
                                  const Matrix6& bound, const Answer& answer);
/// Prints why there is none, and returns the document.
[[nodiscard]] nlohmann::json no_pose(const std::string& file, const Answer& answer, const std::string& why);

}  // namespace narpa::cli
