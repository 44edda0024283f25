/// protocols/can/signal_values.h - physical quantities to raw signals and back, by the tables of signals.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

#include "base/pose.h"
#include "protocols/can/signal_set.h"
#include "protocols/can/signals.h"

namespace narpa {

using SignalTable = std::span<const Signal>;

inline constexpr int kTimeBits = 48;            ///< of a time in nanoseconds
inline constexpr double kUnitTolerance = 1e-3;  ///< of a quaternion's norm

/// The part of a time that travels.
[[nodiscard]] constexpr std::int64_t time_steps(std::int64_t t_ns) noexcept {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(t_ns) &
                                     static_cast<std::uint64_t>(raw_max(false, kTimeBits)));
}

/// In the signal's steps, within its range; what is not finite is not available, and saturated where there is no
/// sign to say that.
[[nodiscard]] inline std::int64_t steps(double value, const Signal& signal) noexcept {
    const std::int64_t limit = raw_max(signal.is_signed, signal.classic.length);
    if (!std::isfinite(value)) return signal.is_signed ? kNotAvailable : limit;
    const double scaled = std::round(value * signal.steps_per_unit), most = static_cast<double>(limit);
    return static_cast<std::int64_t>(std::clamp(scaled, signal.is_signed ? -most : 0.0, most));
}

/// Three signals from `first` on.
inline void put(RawSignals& raw, SignalTable table, std::size_t first, const Vec3& v) noexcept {
    for (int k = 0; k < 3; ++k) {
        const std::size_t i = first + static_cast<std::size_t>(k);
        raw[i] = steps(v[k], table[i]);
    }
}
/// Four signals from `first` on: w, x, y, z.
inline void put(RawSignals& raw, SignalTable table, std::size_t first, const Quat& q) noexcept {
    raw[first] = steps(q.w, table[first]);
    put(raw, table, first + 1, q.vec());
}

[[nodiscard]] inline double value_of(const RawSignals& raw, SignalTable table, std::size_t i) noexcept {
    return static_cast<double>(raw[i]) / table[i].steps_per_unit;
}
[[nodiscard]] inline Vec3 vector_of(const RawSignals& raw, SignalTable table, std::size_t first) noexcept {
    return {value_of(raw, table, first), value_of(raw, table, first + 1), value_of(raw, table, first + 2)};
}
/// As it travelled: not normalised.
[[nodiscard]] inline Quat attitude_of(const RawSignals& raw, SignalTable table, std::size_t first) noexcept {
    const Vec3 v = vector_of(raw, table, first + 1);
    return {value_of(raw, table, first), v.x, v.y, v.z};
}

/// `complete`, or `not_unit`.
[[nodiscard]] inline DecodeStatus judge_attitude(const Quat& q) noexcept {
    return std::abs(norm(q) - 1.0) <= kUnitTolerance ? DecodeStatus::complete : DecodeStatus::not_unit;
}

}  // namespace narpa
