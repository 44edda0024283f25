/// protocols/can/identifiers.h - how CAN identifiers are divided among messages. Each message's own is in its file
/// in messages/.
///
/// Sets of frames have base identifiers in multiples of 16: classic frame i is at base + i, the CAN FD frame at
/// base + 15. Bodies have 0x000 to 0x5F0 (`can_id` in the scene); telemetry and the closed loop are above.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "base/result.h"

namespace narpa {

inline constexpr std::uint32_t kBaseIdStep = 16, kFdOffset = 15;

inline constexpr std::uint32_t kMaxBodyBaseId = 0x5F0, kDefaultBodyBaseId = 0x100;
inline constexpr std::uint32_t kTelemetryBaseId = 0x600;  ///< ledgers: one set per camera, 0x600, 0x610, ...
inline constexpr std::uint8_t kMaxTelemetryCameras = 16;

[[nodiscard]] constexpr std::uint32_t ledger_base_id(std::uint8_t camera) noexcept {
    return kTelemetryBaseId + kBaseIdStep * (camera % kMaxTelemetryCameras);
}
/// The camera whose ledger has frames of this identifier.
[[nodiscard]] constexpr std::optional<std::uint8_t> ledger_camera(std::uint32_t id) noexcept {
    if (id < kTelemetryBaseId || id >= kTelemetryBaseId + kBaseIdStep * kMaxTelemetryCameras) return std::nullopt;
    return static_cast<std::uint8_t>((id - kTelemetryBaseId) / kBaseIdStep);
}

/// An Error (bad_input, without file) where a body's `can_id` is not allowed.
Status check_body_base_id(std::int64_t can_id);

/// A body that is commanded on CAN.
struct CanBody {
    std::string name;
    std::uint32_t base_id = 0;  ///< the body's can_id
};

}  // namespace narpa
