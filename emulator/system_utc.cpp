#include "emulator/system_utc.h"

#include <fmt/format.h>
#include <sys/timex.h>

#include <cstdlib>
#include <ctime>

#include "base/time.h"

namespace narpa {
namespace {

std::int64_t realtime_ns() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_REALTIME, &t);
    return t.tv_sec * kSecond_ns + t.tv_nsec;
}

}  // namespace

UtcOffset read_utc_offset() noexcept {
    // The tightest of a few readings: a thread may be interrupted between the two clocks.
    constexpr int kReadings = 8;
    constexpr std::int64_t kTight_ns = 200;
    UtcOffset best{0, INT64_MAX};
    for (int i = 0; i < kReadings && best.uncertainty_ns > kTight_ns; ++i) {
        const std::int64_t before = monotonic_ns(), utc = realtime_ns(), after = monotonic_ns();
        const std::int64_t half = (after - before) / 2;
        if (half < best.uncertainty_ns) best = {utc - before - half, half};
    }
    return best;
}

ClockDiscipline read_clock_discipline() noexcept {
    timex t{};  // modes = 0: nothing is set
    const int state = ::adjtimex(&t);
    ClockDiscipline d;
    d.synchronised = state >= 0 && state != TIME_ERROR && (t.status & STA_UNSYNC) == 0;
    // ptp4l and phc2sys state no estimate: esterror keeps the kernel's initial value (NTP_PHASE_LIMIT).
    constexpr long kNotStated_us = 16'000'000;
    if (d.synchronised) {
        if (t.esterror < kNotStated_us) d.error_ns = t.esterror * 1000;
        d.error_max_ns = t.maxerror * 1000;
    }
    // freq, in units of 2^-16 ppm, reaches 500 ppm; ptp4l and phc2sys correct more by the length of the kernel's
    // tick, nominally 10000 us, of which 1 us is 100 ppm.
    d.frequency_ppb = t.freq * 1000 / 65536 + (t.tick - 10'000) * 100'000;
    d.tai_less_utc_s = t.tai;
    d.leap_second_today = state == TIME_INS || state == TIME_DEL;
    return d;
}

std::string error_text(std::int64_t error_ns) {
    return error_ns < 0 ? "error not stated"
                        : fmt::format("estimated error {:g} us", 1e-3 * static_cast<double>(error_ns));
}

std::int64_t SystemUtc::offset_ns() noexcept {
    const UtcOffset now = read_();
    std::int64_t held = offset_ns_.load(std::memory_order_relaxed);
    const std::int64_t change = now.offset_ns - held;
    if (std::llabs(change) <= kNoise_ns + now.uncertainty_ns) return held;
    // Of several threads that notice the step one counts it.
    if (offset_ns_.compare_exchange_strong(held, now.offset_ns, std::memory_order_relaxed)) {
        last_step_ns_.store(change, std::memory_order_relaxed);
        steps_.fetch_add(1, std::memory_order_relaxed);
    }
    return now.offset_ns;
}

}  // namespace narpa
