/// emulator/emulator.h - the emulator: CAN bus and sensors of one scene, run in real time or in lockstep.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "emulator/bus/can_node.h"
#include "emulator/online_estimator.h"
#include "emulator/realtime.h"
#include "emulator/sensor.h"

namespace narpa {

struct TracingThreads;

struct RunOptions {
    std::string bus;                                                ///< BUS; empty: no commands
    std::vector<std::pair<std::string, std::string>> video, lidar;  ///< sensor name and SINK; a name may repeat
    bool lockstep = false;
    double duration_s = 0;   ///< of simulation time; 0: until stopped or until a recorded bus ends
    std::string log_folder;  ///< empty: no log
    bool log_shots = false;  ///< logs the truth of every LiDAR shot too, at the cost of a second ray for each
    int threads = 0;         ///< tracing threads; 0: one per core, or one per entry of `cpus`
    std::vector<int> cpus;   ///< processors that tracing threads are bound to in real time; empty: any
    std::optional<TrackerOptions> estimate{};              ///< estimate a target's pose during the run
    std::string estimate_camera;                           ///< empty: the first camera with a sink
    std::function<void(const std::string&)> on_refusal{};  ///< in lockstep, once, when CanNode::refuses_poses
};

class Emulator {
public:
    /// Opens everything and allocates all memory that the loop needs.
    static Result<std::unique_ptr<Emulator>> create(Scene scene, const RunOptions& options);
    ~Emulator();

    /// Adds to the table of sensors. Before `run`.
    void add_sensor(std::unique_ptr<Sensor> sensor) { sensors_.push_back(std::move(sensor)); }
    /// Runs until the duration is over, the bus has ended or the flag is set; then flushes everything. Returns the
    /// first error of a file that could not be written.
    Status run(const StopFlag& stop);

    [[nodiscard]] const World& world() const noexcept { return *world_; }
    [[nodiscard]] CanNode* can() noexcept { return can_.get(); }
    [[nodiscard]] const CanNode* can() const noexcept { return can_.get(); }
    [[nodiscard]] const std::vector<std::unique_ptr<Sensor>>& sensors() const noexcept { return sensors_; }
    /// The sensors of one kind, in the table's order.
    template <class Kind>
    [[nodiscard]] std::vector<const Kind*> sensors_of() const {
        std::vector<const Kind*> found;
        for (const auto& sensor : sensors_)
            if (const auto* one = dynamic_cast<const Kind*>(sensor.get())) found.push_back(one);
        return found;
    }
    /// Null without RunOptions::estimate.
    [[nodiscard]] const OnlineEstimator* estimator() const noexcept { return estimator_.get(); }
    [[nodiscard]] const RunOptions& options() const noexcept { return options_; }
    /// Simulation time reached. From any thread.
    [[nodiscard]] std::int64_t t_ns() const noexcept { return t_ns_.load(std::memory_order_relaxed); }
    /// Page faults of a run in real time, from time 0 to the last item.
    [[nodiscard]] PageFaults page_faults() const noexcept { return page_faults_; }
    /// Messages about the run for the user: what the kernel did not permit, what was refused or left out. Filled by
    /// `run`.
    [[nodiscard]] const std::vector<std::string>& notices() const noexcept { return notices_; }
    /// `run` was stopped by its flag: it did not end by itself.
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }
    /// The bodies with a can_id for which no command was accepted, by name and identifier; empty: none. After
    /// `run`.
    [[nodiscard]] std::string bodies_without_a_pose() const;

private:
    struct RealTimeRun;

    Emulator();
    Status open();
    /// Replaces the logs of an earlier run in the folder.
    Status open_logs();

    void run_real_time(const StopFlag& stop);
    void become_real_time(const char* name, int priority);
    void run_sensor(Sensor& sensor, RealTimeRun& run, const StopFlag& stop);
    void run_bus(RealTimeRun& run, const StopFlag& stop);
    void run_estimator(const StopFlag& stop);

    /// Send on the CAN bus, if any: what sensors and estimator have gathered; the state, with the faults since the
    /// last heartbeat. One thread calls them.
    void send_telemetry(std::int64_t t_ns) noexcept;
    void send_heartbeat(std::int64_t t_ns, RunState state) noexcept;

    /// Why pose commands were refused, as notices.
    [[nodiscard]] std::vector<std::string> refusals() const;
    void note_losses();

    void run_lockstep(const StopFlag& stop);
    void advance_to(std::int64_t t_ns, LockstepClock& clock, const StopFlag& stop);

    RunOptions options_;
    std::int64_t end_ns_ = Clock::kNever;  ///< of the simulation clock
    std::unique_ptr<World> world_;
    std::unique_ptr<CanBus> bus_;
    std::unique_ptr<RowLog> can_log_;
    std::unique_ptr<CanNode> can_;
    std::vector<std::unique_ptr<Sensor>> sensors_;
    std::unique_ptr<OnlineEstimator> estimator_;
    Heartbeat faults_{};  ///< since the last heartbeat
    std::uint64_t drops_reported_ = 0;
    std::unique_ptr<TracingThreads> threads_;
    std::atomic<std::int64_t> t_ns_{0};
    std::atomic<bool> no_priority_{false};
    PageFaults page_faults_{};
    bool stopped_ = false;
    std::vector<std::string> notices_;
};

}  // namespace narpa
