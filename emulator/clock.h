/// emulator/clock.h - the simulation clock of a run, in integer nanoseconds: real time or lockstep.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <ctime>
#include <limits>

#include "base/stop.h"
#include "base/time.h"

namespace narpa {

/// The part of the clock that sensors read. One clock per run; any thread may read it.
class Clock {
public:
    static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

    virtual ~Clock() = default;
    [[nodiscard]] virtual std::int64_t now_ns() const noexcept = 0;
    [[nodiscard]] virtual bool is_real_time() const noexcept = 0;
    /// Simulation time `t_ns` on CLOCK_MONOTONIC.
    [[nodiscard]] virtual std::int64_t to_monotonic(std::int64_t t_ns) const noexcept = 0;

    /// End of the run; kNever: it runs until it is stopped.
    [[nodiscard]] std::int64_t end_ns() const noexcept { return end_ns_.load(std::memory_order_relaxed); }
    void end_at(std::int64_t t_ns) noexcept { end_ns_.store(t_ns, std::memory_order_relaxed); }

private:
    std::atomic<std::int64_t> end_ns_{kNever};
};

/// CLOCK_MONOTONIC since `start`.
class RealTimeClock final : public Clock {
public:
    /// Time 0 is `lead_ns` from now. Before other threads read the clock.
    void start(std::int64_t lead_ns) noexcept { start_ns_ = monotonic_ns() + lead_ns; }

    [[nodiscard]] std::int64_t now_ns() const noexcept override { return monotonic_ns() - start_ns_; }
    [[nodiscard]] bool is_real_time() const noexcept override { return true; }
    [[nodiscard]] std::int64_t to_monotonic(std::int64_t t_ns) const noexcept override { return t_ns + start_ns_; }

    /// Sleeps until the absolute time `t_ns`, checking the flag ten times a second. False: stopped.
    [[nodiscard]] bool wait_until(std::int64_t t_ns, const StopFlag& stop) const noexcept {
        constexpr std::int64_t kSlice = 100'000'000;
        while (!stop.load(std::memory_order_relaxed)) {
            const std::int64_t now = now_ns();
            if (now >= t_ns) return true;
            const std::int64_t until = to_monotonic(std::min(t_ns, now + kSlice));
            const timespec ts{until / kSecond_ns, until % kSecond_ns};
            ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &ts, nullptr);
        }
        return false;
    }

private:
    std::int64_t start_ns_ = 0;
};

/// The first of the times due_ns + k * period_ns after `now_ns`: missed ones are skipped.
[[nodiscard]] constexpr std::int64_t next_due_ns(std::int64_t due_ns, std::int64_t period_ns,
                                                 std::int64_t now_ns) noexcept {
    return due_ns + ((now_ns - due_ns) / period_ns + 1) * period_ns;
}

/// Stands still while a sensor works: work takes no simulation time, so results do not depend on wall time.
class LockstepClock final : public Clock {
public:
    void set(std::int64_t t_ns) noexcept { now_ns_ = t_ns; }

    [[nodiscard]] std::int64_t now_ns() const noexcept override { return now_ns_; }
    [[nodiscard]] bool is_real_time() const noexcept override { return false; }
    /// The current time for every `t_ns`: nothing in lockstep waits for it.
    [[nodiscard]] std::int64_t to_monotonic(std::int64_t) const noexcept override { return monotonic_ns(); }

private:
    std::int64_t now_ns_ = 0;
};

}  // namespace narpa
