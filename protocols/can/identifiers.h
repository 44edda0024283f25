/// protocols/can/identifiers.h - the CAN identifiers of all messages, and their rates.
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
inline constexpr std::uint32_t kHeartbeatId = 0x701;  ///< CiA 301: 0x700 + node identifier 1
inline constexpr std::uint32_t kEstimateBaseId = 0x710;
inline constexpr std::uint32_t kActuatorBaseId = 0x720, kNavigationBaseId = 0x730;          ///< from navigation
inline constexpr std::uint32_t kAttitudeBaseId = 0x740, kDynamicsBaseId = 0x750;            ///< from dynamics
inline constexpr std::uint32_t kCameraCommandBaseId = 0x760, kCameraTriggerBaseId = 0x770;  ///< to cameras
inline constexpr std::uint32_t kCameraReplyBaseId = 0x780, kCameraStateBaseId = 0x790;      ///< from cameras
inline constexpr std::uint32_t kLidarBeamBaseId = 0x7A0;                                    ///< from LiDARs
inline constexpr std::uint32_t kSyncId = 0x080;  ///< CiA 301: the SYNC object

/// True for messages between navigation and dynamics.
[[nodiscard]] constexpr bool is_closed_loop(std::uint32_t id) noexcept {
    return id >= kActuatorBaseId && id < kDynamicsBaseId + kBaseIdStep;
}

inline constexpr std::int64_t kHeartbeatPeriodNs = 100'000'000;  ///< in real time; in lockstep one per command

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
/// What a frame of this identifier carries: "pose of chaser, part 3", "heartbeat"; "frame" where it is no message.
[[nodiscard]] std::string message_name(std::uint32_t id, std::span<const CanBody> bodies);

}  // namespace narpa
