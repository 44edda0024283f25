/// base/time.h - integer nanoseconds, and the clock that the kernel stamps CAN and video frames with.
#pragma once

#include <cstdint>
#include <ctime>

namespace narpa {

inline constexpr std::int64_t kSecond_ns = 1'000'000'000;

[[nodiscard]] inline std::int64_t clock_ns(clockid_t clock) noexcept {
    timespec t{};
    ::clock_gettime(clock, &t);
    return t.tv_sec * kSecond_ns + t.tv_nsec;
}

/// CLOCK_MONOTONIC, which std::chrono::steady_clock reads too.
[[nodiscard]] inline std::int64_t monotonic_ns() noexcept {
    return clock_ns(CLOCK_MONOTONIC);
}

[[nodiscard]] constexpr double to_seconds(std::int64_t ns) noexcept {
    return static_cast<double>(ns) * 1e-9;
}
/// Time since `start_ns`, a value of monotonic_ns().
[[nodiscard]] inline double seconds_since(std::int64_t start_ns) noexcept {
    return to_seconds(monotonic_ns() - start_ns);
}

}  // namespace narpa
