/// protocols/can/messages.h - all messages on CAN: pose commands; heartbeat, frame ledgers and estimates of narpa;
/// those of cameras, LiDARs and a closed loop. README.md documents their bytes. A new one is a file in messages/,
/// which is included here, and a row of can_messages().
#pragma once

#include "protocols/can/messages/camera.h"
#include "protocols/can/messages/clock.h"
#include "protocols/can/messages/closed_loop.h"
#include "protocols/can/messages/estimate.h"
#include "protocols/can/messages/frame_ledger.h"
#include "protocols/can/messages/heartbeat.h"
#include "protocols/can/messages/lidar_beam.h"
#include "protocols/can/messages/pose_command.h"

namespace narpa {

/// The table of all messages, in the order of the DBC.
[[nodiscard]] std::span<const SetLayout* const> can_messages() noexcept;

/// What a frame of this identifier carries: "pose of chaser, part 3", "heartbeat"; "frame" where it is no message.
[[nodiscard]] std::string message_name(std::uint32_t id, std::span<const CanBody> bodies);
/// True for messages between navigation and dynamics: narpa neither sends nor needs them.
[[nodiscard]] bool is_closed_loop(std::uint32_t id) noexcept;

}  // namespace narpa
