/// emulator/frame_observer.h - what else a run's frames are used for, beside their sinks: pose estimates,
/// statistics. Options of a run name them (RunOptions::observers); the loop knows no kind of them.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/pixel_format.h"
#include "base/result.h"
#include "base/stop.h"
#include "emulator/world.h"
#include "protocols/ledger.h"

namespace narpa {

class CanNode;
class McapLog;

/// Observes the frames of one camera. One thread at a time calls it, except for send_telemetry.
class FrameObserver {
public:
    virtual ~FrameObserver() = default;

    /// "estimate": names its part of the report and its thread; at most 9 characters.
    [[nodiscard]] virtual std::string_view name() const noexcept = 0;
    /// What it does, for the user.
    [[nodiscard]] virtual std::string description() const = 0;
    /// Index of its camera in the scene.
    [[nodiscard]] virtual std::size_t camera() const noexcept = 0;

    /// Creates its logs in this folder, before the run; without this call there are none. `wait_when_full`:
    /// RowLog::create.
    virtual Status log_to(const std::string& /*folder*/, bool /*wait_when_full*/) { return Ok{}; }
    /// Gives what it finds to this log too, which outlives the run. Called before the run.
    virtual void record_to(McapLog& /*log*/) {}
    /// A frame that was handed over, and where the bodies were at mid-exposure. In lockstep every frame, from the
    /// loop, which waits. In real time on a thread of its own, without priority and in a TBB arena of one thread;
    /// frames that come while it is busy are skipped.
    virtual void observe(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) = 0;
    /// Sends what has gathered for the CAN bus. From the CAN thread, beside `observe`.
    virtual void send_telemetry(CanNode& /*can*/, std::int64_t /*t_ns*/) noexcept {}
    /// After the run. Returns the first file that could not be written.
    virtual Status finish() { return Ok{}; }
    /// Its part of the report as JSON, and as lines of text. `skipped`: frames.
    [[nodiscard]] virtual nlohmann::json report(std::uint64_t skipped) const = 0;
    [[nodiscard]] virtual std::string to_text(std::uint64_t skipped) const = 0;
};

/// Makes an observer, when the sensors are open. `cameras`: indices of those that run.
using OpenFrameObserver = std::function<Result<std::unique_ptr<FrameObserver>>(
    const World& world, std::span<const std::size_t> cameras, bool lockstep)>;

/// Passes the frames of a camera to an observer: in lockstep at once, in real time through a buffer of one frame.
class FrameFeed {
public:
    FrameFeed(std::unique_ptr<FrameObserver> observer, const World& world, bool lockstep);

    /// From the camera's thread. In real time: copies the frame if the observer is idle; never waits.
    void take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at);
    /// The observer's thread: passes frames on until `stop` is set and `wake` was called.
    void run(const StopFlag& stop);
    void wake() noexcept;

    [[nodiscard]] FrameObserver& observer() const noexcept { return *observer_; }
    /// Frames that came while the observer was busy. After the run.
    [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }

private:
    enum Slot : int { empty, full };

    std::unique_ptr<FrameObserver> observer_;
    bool lockstep_;
    std::atomic<int> slot_{empty};
    FrameLedger ledger_;
    std::vector<std::uint8_t> bytes_;
    BodyPoses at_;
    std::uint64_t skipped_ = 0;  ///< the camera's thread only, until the end of the run
};

}  // namespace narpa
