/// drivers/can/remote_clock.h - the emulator's clock, as those learn it who share its bus.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "base/result.h"
#include "base/stop.h"
#include "drivers/can/can_bus.h"
#include "protocols/can/messages.h"

namespace narpa {

/// The simulation clock of `narpa run` as its heartbeats tell it. Allocates nothing.
class RemoteClock {
public:
    /// Takes in a heartbeat; false: the frame is something else.
    bool accept(const ReceivedFrame& received) noexcept;
    /// Takes in what has arrived; what is no heartbeat is passed over.
    void listen(CanBus& bus) noexcept;
    /// Without heartbeats: time 0 is now.
    void start_here() noexcept;

    [[nodiscard]] bool heard() const noexcept { return heard_; }
    /// In real time: what the emulator's clock shows now. Heartbeats carry whole microseconds.
    [[nodiscard]] std::int64_t now_ns() const noexcept;
    /// Of the last heartbeat; its time is where the clock stands in lockstep.
    [[nodiscard]] const Heartbeat& newest() const noexcept { return newest_; }
    /// In lockstep: all that falls due up to t_ns has been made. What stands at 0 before it started does not count.
    [[nodiscard]] bool reached(std::int64_t t_ns) const noexcept {
        constexpr std::int64_t kRoundingNs = 1000;
        return heard_ && newest_.state != RunState::starting && newest_.t_ns + kRoundingNs > t_ns;
    }

private:
    Heartbeat newest_{};
    std::int64_t offset_ns_ = 0;
    bool heard_ = false;
};

/// As a client; where there is no such bus yet (the emulator may still be reading its scene) it tries again for
/// wait_s seconds, or until stopped.
Result<std::unique_ptr<CanBus>> join_can_bus(std::string_view spec, double wait_s, const StopFlag& stop);

}  // namespace narpa
