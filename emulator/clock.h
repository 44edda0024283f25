/// emulator/clock.h - the simulation clock of a real-time run: nanoseconds of CLOCK_MONOTONIC since the start.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <ctime>

#include "base/stop.h"

namespace narpa {

[[nodiscard]] inline std::int64_t monotonic_ns() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
}

class Clock {
public:
    /// Time 0 is this far ahead: what starts late for lack of warning starts in time.
    explicit Clock(std::int64_t lead_ns) : start_ns_(monotonic_ns() + lead_ns) {}

    [[nodiscard]] std::int64_t now_ns() const noexcept { return monotonic_ns() - start_ns_; }
    [[nodiscard]] std::int64_t to_monotonic(std::int64_t t_ns) const noexcept { return t_ns + start_ns_; }
    [[nodiscard]] std::int64_t from_monotonic(std::int64_t t_ns) const noexcept { return t_ns - start_ns_; }

    /// Sleeps to the absolute time `t_ns`, looking at the flag ten times a second; false when stopped instead.
    [[nodiscard]] bool wait_until(std::int64_t t_ns, const StopFlag& stop) const noexcept {
        constexpr std::int64_t kSlice = 100'000'000;
        while (!stop.load(std::memory_order_relaxed)) {
            const std::int64_t now = now_ns();
            if (now >= t_ns) return true;
            const std::int64_t until = start_ns_ + std::min(t_ns, now + kSlice);
            const timespec ts{until / 1'000'000'000, until % 1'000'000'000};
            ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &ts, nullptr);
        }
        return false;
    }

private:
    std::int64_t start_ns_;
};

}  // namespace narpa
