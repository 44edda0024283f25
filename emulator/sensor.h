/// emulator/sensor.h - what the loop runs: an instrument that makes one item (frame, packet) after another, each at
/// its due time. The kinds are in sensor_kind.h.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "emulator/clock.h"

namespace narpa {

class CanNode;
class McapLog;
struct Heartbeat;

/// How a sensor runs in real time: on a thread of its own.
struct SensorThread {
    const char* name;  ///< at most 15 characters
    int priority;      ///< SCHED_FIFO, below the CAN thread's 60
    bool in_arena;     ///< works on the tracing threads; false: on its own thread alone
};

/// One thread at a time uses a sensor. After `warm_up`, `make_next` neither allocates, locks nor throws.
class Sensor {
public:
    virtual ~Sensor() = default;

    [[nodiscard]] virtual std::string_view kind() const noexcept = 0;  ///< "camera": names its part of the report
    [[nodiscard]] virtual std::string_view name() const noexcept = 0;
    [[nodiscard]] virtual SensorThread thread() const noexcept = 0;
    /// Where its items go, one text for each sink.
    [[nodiscard]] virtual std::vector<std::string> outputs() const = 0;

    /// Creates its logs in this folder. Called before `warm_up`; without this call there are no logs.
    /// `wait_when_full`: RowLog::create.
    virtual Status log_to(const std::string& /*folder*/, bool /*wait_when_full*/) { return Ok{}; }

    /// Gives its items to this log too, which outlives the run. Called before `warm_up`.
    virtual void record_to(McapLog& /*log*/) {}

    // The schedule of the next item, simulation time in ns.

    /// The first item at or after this time is next.
    virtual void start_at(std::int64_t t_ns) noexcept = 0;
    /// Applies what was received for it over CAN, which may change the next item. Called before each reading of the
    /// schedule.
    virtual void plan() noexcept {}
    /// In real time, the schedule is read again after this time while the sensor waits.
    [[nodiscard]] virtual std::int64_t schedule_holds_ns() const noexcept { return kSecond_ns; }
    /// The latest pose that the item needs; Clock::kNever where the sensor waits for a trigger. In lockstep, items
    /// are made in this order, once commands reach it; a run that ends at t contains the items with last_pose_ns()
    /// < t.
    [[nodiscard]] virtual std::int64_t last_pose_ns() const noexcept = 0;
    /// When the item can be made; not before last_pose_ns().
    [[nodiscard]] virtual std::int64_t due_ns() const noexcept = 0;

    /// Makes items and discards them: triggers one-time allocations and page faults, and measures durations. Called
    /// in real time, before the clock starts, by the thread that will make the rest.
    virtual void warm_up() = 0;
    /// Makes the next item, hands it to the sinks and counts it. In real time, skips the items that are too late.
    virtual void make_next(const Clock& clock) = 0;

    /// Registers what it receives over CAN. Called once before the run, if there is a bus, which outlives it.
    virtual void connect(CanNode& /*can*/) {}
    /// Sends what has gathered for the CAN bus since the last call and adds its faults to the next heartbeat. From
    /// the CAN thread, beside make_next.
    virtual void send_telemetry(CanNode& /*can*/, std::int64_t /*t_ns*/, Heartbeat& /*faults*/) noexcept {}
    /// Items that sinks have dropped so far. From any thread.
    [[nodiscard]] virtual std::uint64_t drops() const noexcept { return 0; }

    /// How it keeps up, for the line of progress: "nav: 3 late, 0 skipped"; empty: nothing to tell. From any
    /// thread.
    [[nodiscard]] virtual std::string progress() const { return {}; }

    /// Items made. After the run.
    [[nodiscard]] virtual std::uint64_t made() const noexcept = 0;
    /// Why the run has failed, and how it would keep up: a sentence each; empty: it has not, it does.
    [[nodiscard]] virtual std::string failure() const { return {}; }
    [[nodiscard]] virtual std::string advice() const { return {}; }

    /// After the run: flushes sinks and logs. Returns the first file that could not be written.
    virtual Status finish() = 0;
    /// Statistics of the run, as a JSON object, and the same as lines of text: in lockstep without those that
    /// compare with wall time.
    [[nodiscard]] virtual nlohmann::json report() const = 0;
    [[nodiscard]] virtual std::string to_text(bool lockstep) const = 0;
};

}  // namespace narpa
