/// emulator/clock.h - the simulation clock of a run, in integer nanoseconds: real time or lockstep.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <ctime>
#include <limits>

#include "base/stop.h"
#include "base/time.h"
#include "emulator/system_utc.h"

namespace narpa {

/// UTC of a run: what time stamps on the wire state.
struct RunUtc {
    std::int64_t zero_unix_ns = 0;  ///< UTC of simulation time 0, since 1970, as the clock has it now
    bool synchronised = true;       ///< its source is; always where UTC is simulated
    std::int64_t error_ns = -1;     ///< its estimated error; -1: unknown, or it is simulated
};

/// The part of the clock that sensors read. One clock per run; any thread may read it.
class Clock {
public:
    static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

    virtual ~Clock() = default;
    [[nodiscard]] virtual std::int64_t now_ns() const noexcept = 0;
    [[nodiscard]] virtual bool is_real_time() const noexcept = 0;
    /// Simulation time `t_ns` on CLOCK_MONOTONIC.
    [[nodiscard]] virtual std::int64_t to_monotonic(std::int64_t t_ns) const noexcept = 0;
    [[nodiscard]] virtual RunUtc utc() const noexcept { return {.zero_unix_ns = epoch_unix_ns_}; }

    /// The simulated UTC of simulation time 0. Before the run.
    void set_epoch(std::int64_t unix_ns) noexcept { epoch_unix_ns_ = unix_ns; }
    /// End of the run; kNever: it runs until it is stopped.
    [[nodiscard]] std::int64_t end_ns() const noexcept { return end_ns_.load(std::memory_order_relaxed); }
    void end_at(std::int64_t t_ns) noexcept { end_ns_.store(t_ns, std::memory_order_relaxed); }

private:
    std::int64_t epoch_unix_ns_ = 0;
    std::atomic<std::int64_t> end_ns_{kNever};
};

/// CLOCK_MONOTONIC since `start`. The kernel slews it with the system's UTC and never steps it: times of exposures
/// follow the rate of a disciplined clock, and no step of it moves them.
class RealTimeClock final : public Clock {
public:
    /// `system`: UTC is the system's, else simulated. It must outlive the clock.
    explicit RealTimeClock(SystemUtc* system = nullptr) noexcept : system_(system) {}

    /// Time 0 is `lead_ns` from now; of the system's UTC, at the first whole second after that. Before other
    /// threads read the clock.
    void start(std::int64_t lead_ns) noexcept {
        start_ns_ = monotonic_ns() + lead_ns;
        if (system_ == nullptr) return;
        const std::int64_t offset_ns = system_->offset_ns();
        start_ns_ = (start_ns_ + offset_ns + kSecond_ns - 1) / kSecond_ns * kSecond_ns - offset_ns;
    }
    [[nodiscard]] RunUtc utc() const noexcept override {
        if (system_ == nullptr) return Clock::utc();
        const ClockDiscipline discipline = read_clock_discipline();
        return {start_ns_ + system_->offset_ns(), discipline.synchronised, discipline.error_ns};
    }

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
    SystemUtc* system_;
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
