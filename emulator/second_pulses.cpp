#include "emulator/second_pulses.h"

#include <algorithm>
#include <optional>

namespace narpa {
namespace {

/// The simulation time of the first whole second of UTC after `now_ns`.
std::int64_t next_second(const RealTimeClock& clock, std::int64_t now_ns) noexcept {
    const std::int64_t zero_ns = clock.utc().zero_unix_ns;
    return ((zero_ns + now_ns) / kSecond_ns + 1) * kSecond_ns - zero_ns;
}

/// Waits until the next whole second and returns it; a step of the clock meanwhile moves it. No value: stopped.
std::optional<std::int64_t> wait_for_second(const RealTimeClock& clock, const StopFlag& stop) noexcept {
    constexpr std::int64_t kLook_ns = 50'000'000;
    for (std::int64_t from_ns = clock.now_ns();; from_ns = clock.now_ns()) {
        const std::int64_t second_ns = next_second(clock, from_ns);
        const bool soon = second_ns - from_ns <= kLook_ns;
        if (!clock.wait_until(soon ? second_ns : from_ns + kLook_ns, stop)) return std::nullopt;
        if (soon) return second_ns;
    }
}

}  // namespace

void SecondPulses::run(const RealTimeClock& clock, const StopFlag& stop) noexcept {
    while (const auto second_ns = wait_for_second(clock, stop)) {
        const bool set = line_->set(true);
        const std::int64_t late_ns = clock.now_ns() - *second_ns;
        set ? late_.add(late_ns) : void(++failed_);
        (void)clock.wait_until(*second_ns + std::max(kHigh_ns, late_ns + kHigh_ns / 2), stop);
        (void)line_->set(false);
    }
}

}  // namespace narpa
