#include "drivers/can/remote_clock.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "drivers/descriptor.h"

namespace narpa {

bool RemoteClock::accept(const ReceivedFrame& received) noexcept {
    const std::int64_t before_ns = newest_.t_ns;
    if (decode(received.frame, before_ns, newest_) != DecodeStatus::complete) return false;
    const bool restarted = synchronized_ && newest_.t_ns < before_ns;
    // Within one run, the heartbeat with the least delay gives the most accurate offset.
    const std::int64_t offset_ns = newest_.t_ns - received.t_received_ns;
    offset_ns_ = synchronized_ && !restarted ? std::max(offset_ns_, offset_ns) : offset_ns;
    t_received_ns_ = received.t_received_ns;
    synchronized_ = true;
    restarted_ = restarted_ || restarted;
    return true;
}

void RemoteClock::listen(CanBus& bus) noexcept {
    ReceivedFrame received;
    for (int i = 0; i < kFramesPerTurn && bus.receive(received); ++i) accept(received);
}

void RemoteClock::start_here() noexcept {
    offset_ns_ = -monotonic_ns();
}

std::int64_t RemoteClock::now_ns() const noexcept {
    return monotonic_ns() + offset_ns_;
}

std::int64_t RemoteClock::silence_ns() const noexcept {
    return synchronized_ ? monotonic_ns() - t_received_ns_ : 0;
}

Result<std::unique_ptr<CanBus>> join_can_bus(std::string_view spec, double wait_s, const StopFlag& stop) {
    const std::int64_t deadline_ns = monotonic_ns() + std::llround(wait_s * 1e9);
    for (;;) {
        auto bus = open_can_bus(spec, CanRole::client);
        if (bus || bus.error().kind != ErrorKind::missing || monotonic_ns() >= deadline_ns || stop) return bus;
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
}

}  // namespace narpa
