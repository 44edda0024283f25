/// emulator/emulator.h - the running instrument: bus, cameras and LiDARs of one scene, in real time or in lockstep.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "emulator/camera_feed.h"
#include "emulator/can_node.h"
#include "emulator/estimate_feed.h"
#include "emulator/lidar_feed.h"
#include "emulator/realtime.h"

namespace narpa {

struct TracingThreads;
class StartLine;

struct RunOptions {
    std::string bus;                                                ///< BUS; empty: nothing is commanded
    std::vector<std::pair<std::string, std::string>> video, lidar;  ///< sensor name and SINK, one sensor many times
    bool lockstep = false;
    double duration_s = 0;                     ///< of simulation time; 0: until stopped, or the end of a log
    std::string log_folder;                    ///< empty: no log
    int threads = 0;                           ///< that trace rays; 0: all cores, or as many as `cpus`
    std::vector<int> cpus;                     ///< that these are bound to, in real time; empty: none
    std::optional<TrackerOptions> estimate{};  ///< the pose of a target beside the run, from one camera's frames
    std::string estimate_camera;               ///< empty: the first that puts frames out
};

class Emulator {
public:
    /// Opens everything; nothing moves yet. All memory that the loop needs is taken here.
    static Result<std::unique_ptr<Emulator>> create(Scene scene, const RunOptions& options);
    ~Emulator();

    /// Runs until the duration is over, the bus has ended, or the flag is set; then flushes everything.
    /// Returns the first error of a file that could not be written at the end.
    Status run(const StopFlag& stop);

    [[nodiscard]] const World& world() const noexcept { return *world_; }
    [[nodiscard]] CanNode* can() noexcept { return can_.get(); }
    [[nodiscard]] const std::vector<std::unique_ptr<CameraFeed>>& cameras() const noexcept { return cameras_; }
    [[nodiscard]] const std::vector<std::unique_ptr<LidarFeed>>& lidars() const noexcept { return lidars_; }
    /// Null where nothing is estimated.
    [[nodiscard]] const EstimateFeed* estimates() const noexcept { return estimates_.get(); }
    [[nodiscard]] const RunOptions& options() const noexcept { return options_; }
    /// Simulation time reached.
    [[nodiscard]] std::int64_t t_ns() const noexcept { return t_ns_.load(std::memory_order_relaxed); }
    /// While frames were made in real time.
    [[nodiscard]] PageFaults page_faults() const noexcept { return page_faults_; }
    /// What the kernel did not grant, in plain words; filled by `run`.
    [[nodiscard]] const std::vector<std::string>& notices() const noexcept { return notices_; }

private:
    Emulator();
    Status open_outputs();
    Status open_estimator();

    void run_real_time(const StopFlag& stop);
    void run_camera(CameraFeed& feed, StartLine& start, const StopFlag& stop);
    void run_lidar(LidarFeed& feed, StartLine& start, const StopFlag& stop);
    void run_bus(StartLine& start, const StopFlag& stop);
    void run_estimator(const StopFlag& stop);

    void run_lockstep(const StopFlag& stop);
    void advance_to(std::int64_t t_ns, const StopFlag& stop);

    void send_ledgers(std::int64_t t_ns) noexcept;
    void send_estimates(std::int64_t t_ns) noexcept;
    void send_heartbeat(std::int64_t t_ns, RunState state) noexcept;
    [[nodiscard]] std::uint64_t output_drops() const noexcept;

    RunOptions options_;
    std::atomic<std::int64_t> end_ns_{0};  ///< of the simulation clock
    std::unique_ptr<World> world_;
    std::unique_ptr<CanBus> bus_;
    std::unique_ptr<RowLog> can_log_;
    std::unique_ptr<CanNode> can_;
    std::vector<std::unique_ptr<CameraFeed>> cameras_;
    std::vector<std::unique_ptr<LidarFeed>> lidars_;
    std::unique_ptr<EstimateFeed> estimates_;
    std::unique_ptr<TracingThreads> threads_;
    std::unique_ptr<Clock> clock_;
    std::atomic<std::int64_t> t_ns_{0};
    std::atomic<bool> no_priority_{false};
    PageFaults page_faults_{};  ///< from time 0 to the last frame
    Heartbeat faults_{};        ///< since the last heartbeat
    std::uint64_t drops_told_ = 0;
    std::vector<std::string> notices_;
};

}  // namespace narpa
