/// protocols/can/signals.h - how a message is described: its identifiers, and where each quantity lies on the wire.
/// Encoders, decoders and the DBC are made from these descriptions, which are in messages/.
///
/// A set is a group of quantities that take effect together. On classic CAN it travels as several 8-byte frames at
/// base identifier + 0, + 1, ...: 48 bits of payload, the set's counter (byte 6), CRC-8 (byte 7). On CAN FD it is
/// one 64-byte frame at base identifier + 15: payload, counter, zeros, CRC-16 (last two bytes). Little-endian
/// (Intel) bit order throughout. README.md in this folder shows it with a worked example.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/can/identifiers.h"

namespace narpa {

/// A field of `length` bits whose least significant bit is bit `start_bit` of the payload (bit b is bit b % 8 of
/// byte b / 8). `frame` is the index within a classic set; 0 for CAN FD. length 0: not carried.
struct BitField {
    std::uint8_t frame = 0;
    std::uint16_t start_bit = 0;
    std::uint8_t length = 0;
};

/// A value's name. A signal with choices is an enumeration on the wire.
struct Choice {
    std::int64_t raw = 0;
    std::string_view name{};
};
/// Choices with the values 0, 1, ... in the order of the names.
template <std::size_t N>
[[nodiscard]] constexpr std::array<Choice, N> numbered(const std::array<std::string_view, N>& names) {
    std::array<Choice, N> choices{};
    for (std::size_t i = 0; i < N; ++i) choices[i] = {static_cast<std::int64_t>(i), names[i]};
    return choices;
}

/// physical value = raw / steps_per_unit, where the steps are whole numbers, so that the division rounds only once
/// and decimal values come out as written. The most negative raw value of a signed signal means "not available".
struct Signal {
    std::string_view name{}, unit{}, comment{};
    double steps_per_unit = 1;  ///< 1 / the factor of the DBC
    bool is_signed = false;
    BitField classic{}, fd{};
    std::span<const Choice> choices{};
};

[[nodiscard]] constexpr std::int64_t raw_max(bool is_signed, int length) {
    return (std::int64_t{1} << (is_signed ? length - 1 : length)) - 1;
}
[[nodiscard]] constexpr std::int64_t raw_min(bool is_signed, int length) {
    return is_signed ? -raw_max(is_signed, length) : 0;
}
/// "Not available" on the wire; only for signed signals.
[[nodiscard]] constexpr std::int64_t raw_not_available(int length) {
    return -(std::int64_t{1} << (length - 1));
}

/// Who sends a message and who needs it, as the DBC names them: Commander, narpa, Navigation.
struct Route {
    std::string_view sender{}, receiver{};
};
inline constexpr Route kToNarpa{"Commander", "narpa"}, kFromNarpa{"narpa", "Commander"};

/// How often a message exists on a bus.
enum class Instances : std::uint8_t {
    one,
    per_body,    ///< at the body's can_id
    per_camera,  ///< camera k of the scene: at base_id + k * kBaseIdStep
};

/// The description of one message, its row in can_messages().
struct SetLayout {
    std::string_view name{};   ///< of the CAN FD message
    std::string_view title{};  ///< in texts: "thruster command"
    std::string_view comment{};
    std::uint32_t base_id = 0;
    Route route{};
    std::span<const std::string_view> frames{};  ///< names of the classic messages, at base_id + index
    std::span<const Signal> signals{};
    std::uint16_t fd_counter_bit = 0;  ///< where the counter lies in the FD frame; 0: no FD form
    Instances instances = Instances::one;

    /// `which`: the body's can_id, or the camera's index in the scene.
    [[nodiscard]] constexpr std::uint32_t base_id_of(std::uint32_t which) const noexcept {
        if (instances == Instances::one) return base_id;
        return instances == Instances::per_body ? which : base_id + kBaseIdStep * (which % kMaxTelemetryCameras);
    }
};

/// Concatenates the lists and places their signals one after the other in the CAN FD frame. A signal without a
/// length for CAN FD is as long as on classic CAN.
template <std::size_t... N>
[[nodiscard]] constexpr auto place_fd_signals(const std::array<Signal, N>&... lists) {
    std::array<Signal, (N + ...)> signals{};
    auto* end = signals.data();
    ((end = std::copy(lists.begin(), lists.end(), end)), ...);
    std::uint16_t bit = 0;
    for (Signal& s : signals) {
        s.fd = {0, bit, s.fd.length > 0 ? s.fd.length : s.classic.length};
        bit = static_cast<std::uint16_t>(bit + s.fd.length);
    }
    return signals;
}

/// A message that has a CAN FD form too, with the counter in the first whole byte after its signals.
[[nodiscard]] constexpr SetLayout describe_set(std::string_view name, std::string_view title,
                                               std::string_view comment, std::uint32_t base_id, Route route,
                                               std::span<const std::string_view> frames,
                                               std::span<const Signal> signals,
                                               Instances instances = Instances::one) {
    int bit = 0;
    for (const Signal& s : signals) bit = std::max(bit, s.fd.start_bit + s.fd.length);
    const auto counter_bit = static_cast<std::uint16_t>((bit + 7) / 8 * 8);
    return {name, title, comment, base_id, route, frames, signals, counter_bit, instances};
}

inline constexpr std::size_t kClassicBytes = 8, kFdBytes = 64;
inline constexpr int kClassicPayloadBits = 48;
inline constexpr int kClassicCounterByte = 6, kClassicCrcByte = 7, kFdCrcByte = 62;

// --- Signals that several messages have
// ---------------------------------------------------------------------------

inline constexpr auto kOffOnChoices = std::to_array<Choice>({{0, "off"}, {1, "on"}});

inline constexpr double kPositionSteps_per_m = 1e6;
inline constexpr double kAttitudeSteps = 4194304.0;  ///< 2^22: 1 and -1 fit exactly
inline constexpr double kSigmaRotationSteps_per_rad = 1e7;

/// Classic frames 0 to 5.
[[nodiscard]] constexpr std::array<Signal, 8> pose_signals(std::string_view time, std::string_view position,
                                                           std::string_view attitude) {
    return {{
        {"Time", "ns", time, 1, false, {0, 0, 48}},
        {"PositionX", "m", position, kPositionSteps_per_m, true, {1, 0, 48}},
        {"PositionY", "m", position, kPositionSteps_per_m, true, {2, 0, 48}},
        {"PositionZ", "m", position, kPositionSteps_per_m, true, {3, 0, 48}},
        {"AttitudeW", "", attitude, kAttitudeSteps, true, {4, 0, 24}},
        {"AttitudeX", "", attitude, kAttitudeSteps, true, {4, 24, 24}},
        {"AttitudeY", "", attitude, kAttitudeSteps, true, {5, 0, 24}},
        {"AttitudeZ", "", attitude, kAttitudeSteps, true, {5, 24, 24}},
    }};
}

/// Standard deviations, in classic frames 6 to 8: of the position, and of the attitude, whose axes `about` names.
[[nodiscard]] constexpr std::array<Signal, 6> sigma_signals(std::string_view about) {
    constexpr std::string_view position = "Standard deviation of the position";
    return {{
        {"SigmaX", "m", position, kPositionSteps_per_m, false, {6, 0, 24}},
        {"SigmaY", "m", position, kPositionSteps_per_m, false, {6, 24, 24}},
        {"SigmaZ", "m", position, kPositionSteps_per_m, false, {7, 0, 24}},
        {"SigmaRotX", "rad", about, kSigmaRotationSteps_per_rad, false, {7, 24, 24}},
        {"SigmaRotY", "rad", about, kSigmaRotationSteps_per_rad, false, {8, 0, 24}},
        {"SigmaRotZ", "rad", about, kSigmaRotationSteps_per_rad, false, {8, 24, 24}},
    }};
}

}  // namespace narpa
