/// drivers/can/remote_clock.h - the emulator's clock, from its heartbeats on CAN.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "base/result.h"
#include "base/stop.h"
#include "drivers/can/can_bus.h"
#include "protocols/can/messages.h"

namespace narpa {

/// In real time the emulator sends ten heartbeats a second; after this long without one it counts as gone.
inline constexpr double kHeartbeatSilence_s = 10;

/// The simulation clock of `narpa run`, synchronised by its heartbeats. Allocates nothing.
class RemoteClock {
public:
    /// Updates the clock by a heartbeat; false: the frame is not one.
    bool accept(const ReceivedFrame& received) noexcept;
    /// Reads frames that have arrived, at most kFramesPerTurn, and drops those that are not heartbeats.
    void listen(CanBus& bus) noexcept;
    /// For use without heartbeats: sets time 0 to now.
    void start_here() noexcept;

    [[nodiscard]] bool synchronized() const noexcept { return synchronized_; }
    /// The clock jumped back at least once: a new run of the emulator has begun, and the clock follows it.
    [[nodiscard]] bool restarted() const noexcept { return restarted_; }
    /// In real time: the emulator's time now. Heartbeats carry whole microseconds.
    [[nodiscard]] std::int64_t now_ns() const noexcept;
    /// CLOCK_MONOTONIC since the last heartbeat; 0 before the first.
    [[nodiscard]] std::int64_t silence_ns() const noexcept;
    /// The last heartbeat says that the emulator's run has ended.
    [[nodiscard]] bool stopping() const noexcept { return synchronized_ && newest_.state == RunState::stopping; }
    /// The last heartbeat; in lockstep its time is the simulation time.
    [[nodiscard]] const Heartbeat& newest() const noexcept { return newest_; }
    /// In lockstep: everything due up to t_ns has been sent. Heartbeats in state `starting` do not count.
    [[nodiscard]] bool reached(std::int64_t t_ns) const noexcept {
        constexpr std::int64_t kRoundingNs = 1000;
        return synchronized_ && newest_.state != RunState::starting && newest_.t_ns + kRoundingNs > t_ns;
    }

private:
    Heartbeat newest_{};
    std::int64_t offset_ns_ = 0, t_received_ns_ = 0;
    bool synchronized_ = false, restarted_ = false;
};

/// Opens a bus as a client. While the bus does not exist yet (the emulator may still be reading its scene) it
/// retries for wait_s seconds, or until stopped.
Result<std::unique_ptr<CanBus>> join_can_bus(std::string_view spec, double wait_s, const StopFlag& stop);

}  // namespace narpa
