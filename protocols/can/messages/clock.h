/// protocols/can/messages/clock.h - which UTC the simulation clock stands for, from a run with the system's UTC;
/// and the SYNC and TIME of CiA 301, which are not of narpa's own form.
#pragma once

#include "protocols/can/codec.h"

namespace narpa {

enum class UtcState : std::uint8_t {
    not_synchronised,  ///< nothing disciplines the system's clock, or not yet
    synchronised,
};

struct ClockReport {
    std::uint32_t zero_utc_s = 0;    ///< UTC of simulation time 0: whole seconds since 1970
    double zero_utc_fraction_s = 0;  ///< and the rest, in nanoseconds on the wire
    UtcState state = UtcState::not_synchronised;
    bool leap_second_today = false;   ///< at the end of the UTC day
    std::uint8_t steps = 0;           ///< of the system's clock since the start of the run, modulo 256
    std::int16_t tai_less_utc_s = 0;  ///< 0: not known
    double error_s = 0;               ///< estimated error of UTC; NaN: not known
    double frequency_ppm = 0;         ///< correction of the system's oscillator
    std::uint8_t counter = 0;
    friend bool operator==(const ClockReport&, const ClockReport&) = default;
};

inline constexpr std::uint32_t kClockBaseId = 0x7B0;
inline constexpr std::array<Choice, 2> kUtcStates{{{0, "not_synchronised"}, {1, "synchronised"}}};
inline constexpr std::array<std::string_view, 3> kClockFrames{"ClockSeconds", "ClockFraction", "ClockQuality"};
inline constexpr auto kClockSignals = place_fd_signals(std::to_array<Signal>({
    {"ZeroSeconds", "s", "UTC of simulation time 0 since 1970, whole seconds", 1, false, {0, 0, 32}},
    {"ZeroFraction", "s", "The rest of that UTC", 1e9, false, {1, 0, 32}},
    {"State", "", "Of the system's clock", 1, false, {0, 32, 2}, {}, kUtcStates},
    {"LeapSecondToday", "", "At the end of the UTC day", 1, false, {0, 34, 1}},
    {"Steps", "", "Of the system's clock during the run", 1, false, {0, 40, 8}},
    {"TaiLessUtc", "s", "0: not known", 1, true, {1, 32, 16}},
    {"EstimatedError", "s", "Of UTC; not available: not known", 1e6, true, {2, 0, 24}},
    {"Frequency", "ppm", "Correction of the system's oscillator", 1e3, true, {2, 24, 24}},
}));
inline constexpr SetLayout kClockLayout =
    describe_set("Clock", "clock report", "UTC of the simulation clock, from the system's clock", kClockBaseId,
                 kFromNarpa, kClockFrames, kClockSignals);

template <>
struct Codec<ClockReport> {
    static constexpr const SetLayout& layout = kClockLayout;
    static void fields(auto& m, const auto& each) noexcept {
        each(m.zero_utc_s, m.zero_utc_fraction_s, m.state, m.leap_second_today, m.steps, m.tai_less_utc_s,
             m.error_s, m.frequency_ppm);
    }
    /// The error may be missing.
    static DecodeStatus check(const RawSignals& raw) noexcept { return check_signals(layout.signals, raw, true); }
};

/// TIME: milliseconds after midnight (28 bits) and days since 1984-01-01, little-endian (CiA 301, TIME_OF_DAY).
[[nodiscard]] inline CanFrame canopen_time(std::uint32_t id, std::int64_t unix_ns) noexcept {
    constexpr std::int64_t kDay_ms = 86'400'000, kFirstDay = 5113;  // days from 1970 to 1984
    const std::int64_t ms = unix_ns / 1'000'000;
    const auto of_day = static_cast<std::uint32_t>(ms % kDay_ms);
    const auto day = static_cast<std::uint16_t>(ms / kDay_ms - kFirstDay);
    CanFrame frame{.id = id, .size = 6};
    for (int i = 0; i < 4; ++i)
        frame.data[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(of_day >> 8 * i);
    frame.data[4] = static_cast<std::uint8_t>(day), frame.data[5] = static_cast<std::uint8_t>(day >> 8);
    return frame;
}

}  // namespace narpa
