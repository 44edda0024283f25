/// emulator/emulator.h - the emulator: CAN bus and sensors of one scene, run in real time or in lockstep.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "drivers/pulse/pulse_source.h"
#include "emulator/bus/can_node.h"
#include "emulator/log/mcap_log.h"
#include "emulator/ptp4l_watch.h"
#include "emulator/realtime.h"
#include "emulator/second_pulses.h"
#include "emulator/sensor_kind.h"
#include "emulator/system_utc.h"

namespace narpa {

struct TracingThreads;

class Emulator {
public:
    /// Opens everything and allocates all memory that the loop needs.
    static Result<std::unique_ptr<Emulator>> create(Scene scene, const RunOptions& options,
                                                    std::span<const SensorKind> kinds = sensor_kinds());
    ~Emulator();

    /// The run that follows one that `restarted`: with its world, bus, sinks and threads, and with logs of its own,
    /// which `options` name. Sinks count on.
    static Result<std::unique_ptr<Emulator>> create_next(std::unique_ptr<Emulator> ended,
                                                         const RunOptions& options);
    /// The run has ended because the dynamics began again (TimeSettings::on_restart).
    [[nodiscard]] bool restarted() const noexcept { return can_ && can_->restart(); }

    /// Runs until the duration is over, the bus has ended or the flag is set; then flushes everything. Returns the
    /// first error of a file that could not be written.
    Status run(const StopFlag& stop);

    // A run in lockstep that the caller drives, in place of `run`: it has the other side of the bus, which is
    // within the process (memory:NAME). `begin`, then `advance` after each command that it sends, then `end`.

    void begin();
    /// Takes the frames that wait on the bus, then makes the items for which poses are commanded, up to `until_ns`.
    void advance(std::int64_t until_ns, const StopFlag& stop);
    /// As the end of `run`.
    Status end();

    [[nodiscard]] const World& world() const noexcept { return *world_; }
    [[nodiscard]] CanNode* can() noexcept { return can_.get(); }
    [[nodiscard]] const CanNode* can() const noexcept { return can_.get(); }
    [[nodiscard]] std::span<const SensorKind> kinds() const noexcept { return kinds_; }
    [[nodiscard]] const std::vector<std::unique_ptr<Sensor>>& sensors() const noexcept { return sensors_.all; }
    [[nodiscard]] const std::vector<CameraSensor*>& cameras() const noexcept { return sensors_.cameras; }
    [[nodiscard]] const std::vector<LidarSensor*>& lidars() const noexcept { return sensors_.lidars; }
    [[nodiscard]] const std::vector<std::unique_ptr<FrameFeed>>& observers() const noexcept { return observers_; }
    /// The system's clock, where the run takes UTC from it; else null.
    [[nodiscard]] const SystemUtc* system_utc() const noexcept { return system_utc_.get(); }
    /// ptp4l's state, where the run takes UTC from the system's clock; else null.
    [[nodiscard]] const Ptp4lWatch* ptp4l() const noexcept { return ptp4l_.get(); }
    /// UTC of simulation time 0 at the end of the run.
    [[nodiscard]] const RunUtc& utc() const noexcept { return utc_; }
    [[nodiscard]] const std::vector<std::unique_ptr<PulseSource>>& triggers() const noexcept { return triggers_; }
    /// Null without RunOptions::second_pulses.
    [[nodiscard]] const SecondPulses* second_pulses() const noexcept { return second_pulses_.get(); }
    /// Null without RunOptions::mcap.
    [[nodiscard]] const McapLog* mcap() const noexcept { return mcap_.get(); }
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
    /// In lockstep: the last client that sent commands left before the end that the options state.
    [[nodiscard]] bool abandoned() const noexcept { return abandoned_; }
    /// The bodies with a can_id for which no command was accepted, by name and identifier; empty: none. After
    /// `run`.
    [[nodiscard]] std::string bodies_without_a_pose() const;

private:
    struct RealTimeRun;
    struct LockstepRun {
        LockstepClock clock{};
        bool started = false;  ///< every commanded body has a command
        bool moved = false;    ///< the last frame completed a command
        bool refused = false;  ///< the user has been told of refused commands
    };

    Emulator();
    void take_world(std::unique_ptr<World> world);
    Status open();
    Status open_observers();
    /// Replaces the logs of an earlier run in the folder.
    Status open_logs();
    Status open_mcap();
    Status open_pulses();

    void run_real_time(const StopFlag& stop);
    void become_real_time(const char* name, int priority);
    void run_sensor(Sensor& sensor, RealTimeRun& run, const StopFlag& stop);
    void run_bus(RealTimeRun& run, const StopFlag& stop);
    void run_observer(FrameFeed& feed, const StopFlag& stop);
    /// Exposes the cameras for which pulses have come.
    void take_pulses(const RealTimeClock& clock) noexcept;
    /// Sends what is due of the clock report and CANopen's SYNC and TIME, and returns when the next is.
    std::int64_t send_time(const RealTimeClock& clock, std::int64_t now_ns) noexcept;
    [[nodiscard]] ClockReport clock_report(const RealTimeClock& clock) const noexcept;

    /// Send on the CAN bus, if any: what sensors and observers have gathered; the state, with the faults since the
    /// last heartbeat. One thread calls them.
    void send_telemetry(std::int64_t t_ns) noexcept;
    void send_heartbeat(std::int64_t t_ns, RunState state) noexcept;

    /// Why pose commands were refused, as notices.
    [[nodiscard]] std::vector<std::string> notices_of(const PoseRefusals& refusals) const;
    void report_refusals(const PoseRefusals& refusals) const;
    void note_clock();
    void note_losses();

    void run_lockstep(const StopFlag& stop);
    /// Takes a frame from the bus. False: none waits.
    bool take_frame();
    /// Makes the items for which poses are commanded, up to `until_ns`.
    void make_items(std::int64_t until_ns, const StopFlag& stop);
    void advance_to(std::int64_t t_ns, LockstepClock& clock, const StopFlag& stop);
    /// Flushes everything; the first error of a file.
    Status finish();

    RunOptions options_;
    std::int64_t end_ns_ = Clock::kNever;  ///< of the simulation clock
    std::unique_ptr<World> world_;
    std::unique_ptr<SystemUtc> system_utc_;
    std::unique_ptr<Ptp4lWatch> ptp4l_;
    RunUtc utc_{};
    std::unique_ptr<CanBus> bus_;
    std::unique_ptr<RowLog> can_log_;
    std::unique_ptr<CanNode> can_;
    std::unique_ptr<McapLog> mcap_;
    std::vector<std::unique_ptr<PulseSource>> triggers_;
    std::unique_ptr<SecondPulses> second_pulses_;
    std::span<const SensorKind> kinds_;
    OpenSensors sensors_;
    std::vector<std::unique_ptr<FrameFeed>> observers_;
    Heartbeat faults_{};  ///< since the last heartbeat
    std::uint64_t drops_reported_ = 0;
    /// When the next of each is due: the clock report, SYNC, TIME.
    struct {
        std::int64_t report_ns = 0, sync_ns = 0, time_ns = 0;
        std::uint32_t steps = 0;  ///< in the last report
    } next_time_{};
    std::unique_ptr<TracingThreads> threads_;
    LockstepRun lockstep_{};
    std::atomic<std::int64_t> t_ns_{0};
    std::atomic<bool> no_priority_{false};
    PageFaults page_faults_{};
    bool stopped_ = false, abandoned_ = false;
    std::vector<std::string> notices_;
};

}  // namespace narpa
