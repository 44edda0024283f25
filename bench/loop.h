/// bench/loop.h - how steadily the real-time loop runs, alone and beside processes that keep processors
/// busy.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/flight.h"
#include "emulator/camera/camera_sensor.h"
#include "emulator/emulator.h"
#include "emulator/lidar/lidar_sensor.h"

namespace narpa {

/// Runs a busy loop in a process for each of these processors, pinned to it, at normal priority. The processes end
/// with the object, or with the thread that made it.
class CompetingLoad {
public:
    static Result<CompetingLoad> start(const std::vector<int>& cpus);
    CompetingLoad(CompetingLoad&& other) noexcept : processes_(std::exchange(other.processes_, {})) {}
    CompetingLoad& operator=(CompetingLoad&&) = delete;
    ~CompetingLoad();

    [[nodiscard]] const std::vector<int>& processes() const noexcept { return processes_; }

private:
    CompetingLoad() = default;
    std::vector<int> processes_;  ///< their numbers
};

/// One camera in one run.
struct CameraRun {
    std::string name;
    std::int64_t period_ns = 0;
    std::int64_t allowance_ns = 0;  ///< from the end of the exposure to the deadline of the hand-over
    CameraStats stats;
    nlohmann::json report{};  ///< CameraSensor::report
    Flown flown{};            ///< its frames, in a flight

    /// Frames without a whole image; there must be none.
    [[nodiscard]] std::uint64_t incomplete() const noexcept {
        return stats.steps[static_cast<std::size_t>(FrameStep::nothing)];
    }
    /// Fraction of the frames due that were handed over late, or skipped because the one before was late.
    [[nodiscard]] double late_fraction() const noexcept;
    /// Quantile p of the time of a frame over its allowance; above 1: late.
    [[nodiscard]] double allowance_used(double p) const noexcept;
};

struct LidarRun {
    std::string name;
    LidarStats stats;
    nlohmann::json report{};  ///< LidarSensor::report
};

struct LoopRun {
    std::string name;
    std::vector<int> load;  ///< processors that were kept busy
    std::vector<CameraRun> cameras;
    std::vector<LidarRun> lidars;
    PageFaults page_faults;  ///< from the first frame to the last
    std::vector<std::string> notices;
};

/// Runs the loop once, for `options.duration_s`, beside load on these processors (none: alone). With a bus, it is a
/// flight: frames are kept by range.
[[nodiscard]] Result<LoopRun> run_loop(const std::string& name, const Scene& scene, const RunOptions& options,
                                       const std::vector<int>& load, const StopFlag& stop);

/// What is wrong, one sentence each: no frame, an incomplete one, more than this fraction late. Empty: nothing.
[[nodiscard]] std::vector<std::string> loop_faults(const std::vector<LoopRun>& runs, double late_max);

[[nodiscard]] nlohmann::json to_json(const LoopRun& run);
/// A table, a line for each camera and LiDAR.
[[nodiscard]] std::string to_text(const std::vector<LoopRun>& runs);

/// Plots (plot/plot.h) for each camera how many frames exceed a wake-up latency, a latency, a lateness.
[[nodiscard]] Status plot_loop(const std::string& path, const std::string& title, const std::vector<LoopRun>& runs);

}  // namespace narpa
