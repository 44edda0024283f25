/// emulator/system_utc.h - UTC as the system's clock has it. ptp4l with phc2sys, chrony or ntpd discipline that
/// clock; here it is read and never set.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

namespace narpa {

/// CLOCK_REALTIME less CLOCK_MONOTONIC. The kernel slews both clocks together, so that it changes by steps only: a
/// clock that is set, and leap seconds.
struct UtcOffset {
    std::int64_t offset_ns = 0;
    std::int64_t uncertainty_ns = 0;  ///< half the time that the reading took
};
[[nodiscard]] UtcOffset read_utc_offset() noexcept;

/// What the kernel knows of its clock: adjtimex(2).
struct ClockDiscipline {
    bool synchronised = false;       ///< the one that disciplines the clock says so (STA_UNSYNC is off)
    std::int64_t error_ns = -1;      ///< estimated error of UTC, as it states; -1: it states none, not synchronised
    std::int64_t error_max_ns = -1;  ///< bound of the error
    std::int64_t frequency_ppb = 0;  ///< correction of the clock's frequency: its drift, with the opposite sign
    std::int32_t tai_less_utc_s = 0;  ///< 0: not known
    bool leap_second_today = false;   ///< one is inserted or deleted at the end of the UTC day
};
[[nodiscard]] ClockDiscipline read_clock_discipline() noexcept;
/// "estimated error 12 us"; of -1: "error not stated".
[[nodiscard]] std::string error_text(std::int64_t error_ns);

/// UTC on CLOCK_MONOTONIC, with the steps that the system's clock has made. Any thread may use it.
class SystemUtc {
public:
    /// A change of the offset by less than this is noise of its readings.
    static constexpr std::int64_t kNoise_ns = 1'000;

    using Read = UtcOffset (*)() noexcept;
    explicit SystemUtc(Read read = read_utc_offset) noexcept : read_(read), offset_ns_(read().offset_ns) {}

    /// UTC since 1970 at CLOCK_MONOTONIC 0, from now on. The same value between two steps.
    [[nodiscard]] std::int64_t offset_ns() noexcept;

    [[nodiscard]] std::uint32_t steps() const noexcept { return steps_.load(std::memory_order_relaxed); }
    [[nodiscard]] std::int64_t last_step_ns() const noexcept {
        return last_step_ns_.load(std::memory_order_relaxed);
    }

private:
    Read read_;
    std::atomic<std::int64_t> offset_ns_, last_step_ns_{0};
    std::atomic<std::uint32_t> steps_{0};
};

}  // namespace narpa
