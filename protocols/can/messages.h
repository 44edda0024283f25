/// protocols/can/messages.h - all messages on CAN: pose commands; heartbeat, frame ledgers and estimates of narpa;
/// and those of a closed loop.
///
/// Wire layout: signals.h, ledger_fields.h and README.md; narpa.dbc is written from the same
/// tables. Nothing here allocates (except texts of errors), blocks or throws.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/pose.h"
#include "protocols/can/frame.h"
#include "protocols/can/identifiers.h"
#include "protocols/can/signal_set.h"
#include "protocols/closed_loop.h"
#include "protocols/estimate.h"
#include "protocols/ledger_fields.h"
#include "protocols/lidar_beam.h"

namespace narpa {

// --- Pose command -----------------------------------------------------------------------------------------------

struct PoseCommand {
    std::uint8_t counter = 0;     ///< +1 with every command of a body, wraps
    std::int64_t t_valid_ns = 0;  ///< simulation clock; its low 48 bits are sent
    Motion motion{};              ///< attitude: | |q| - 1 | <= 1e-3
};

/// The quantity that does not fit the wire; `operator bool` is true if all fit.
struct EncodeStatus {
    std::string_view quantity{};  ///< signal name of signals.h, or "AttitudeNorm"; empty: all is well
    std::string_view unit{};
    double value = 0, min = 0, max = 0;

    explicit operator bool() const noexcept { return quantity.empty(); }
    /// "VelocityX = 12000 m/s is outside -10737.4 .. 10737.4 m/s".
    [[nodiscard]] std::string text() const;
};

/// The nine classic frames at base_id + 0 .. 8. Leaves `out` as it was unless the status is good.
[[nodiscard]] EncodeStatus encode_classic(const PoseCommand& command, std::uint32_t base_id,
                                          FrameSet& out) noexcept;
/// The one CAN FD frame at base_id + 15, in the same steps.
[[nodiscard]] EncodeStatus encode_fd(const PoseCommand& command, std::uint32_t base_id, CanFrame& out) noexcept;
/// The form that the bus carries.
[[nodiscard]] EncodeStatus encode(const PoseCommand& command, std::uint32_t base_id, bool fd,
                                  FrameSet& out) noexcept;

using PoseStatus = DecodeStatus;

/// Reads the pose commands of one body, classic or FD. One for each body; fixed size.
class PoseDecoder {
public:
    explicit PoseDecoder(std::uint32_t base_id) noexcept;

    /// `t_reference_ns` (simulation clock, within 39 h of the command) resolves the 48-bit time. Writes `out`, with
    /// its quaternion normalised, only when the status is `complete`. Whether a command is too late is for the
    /// receiver to decide. `incomplete_set` is never returned, only counted: see SetDecoder.
    [[nodiscard]] PoseStatus accept(const CanFrame& frame, std::int64_t t_reference_ns, PoseCommand& out) noexcept;

    [[nodiscard]] std::uint32_t base_id() const noexcept { return set_.base_id(); }
    [[nodiscard]] std::uint64_t count(PoseStatus status) const noexcept { return set_.count(status); }

private:
    SetDecoder set_;
};

// --- All others -------------------------------------------------------------------------------------------------

enum class RunState : std::uint8_t { starting, running, lockstep, stopping };

struct Heartbeat {
    std::int64_t t_ns = 0;  ///< simulation clock; sent in whole microseconds
    RunState state = RunState::starting;
    bool no_command = false, stale = false, deadline_missed = false, output_dropped = false;
    std::uint8_t counter = 0;  ///< +1 with every heartbeat, wraps
    friend bool operator==(const Heartbeat&, const Heartbeat&) = default;
};

/// The heartbeat's one frame, at kHeartbeatId.
[[nodiscard]] CanFrame encode(const Heartbeat& heartbeat) noexcept;
/// Writes `out` only when the status is `complete`.
[[nodiscard]] DecodeStatus decode(const CanFrame& frame, std::int64_t t_reference_ns, Heartbeat& out) noexcept;

/// Message: FrameLedger, EstimateReport; of operated cameras CameraCommand, CameraTrigger, CameraReply,
/// CameraState; LidarBeamReport; and of the closed loop ActuatorCommand, NavigationEstimate, AttitudeReport,
/// DynamicsReport. The counter of a set is the message's own, or the low 8 bits of its frame or cycle number.
/// Values beyond a signal's range saturate; numbers that are not finite are "not available".
///
/// Ledger: times other than exposure mid and pose time are sent as whole microseconds after exposure mid. Of the
/// passes only their number is sent; the samples of each are in the log. Estimate: in state `lost`, pose and
/// deviations are "not available" and are not read.
template <class Message>
[[nodiscard]] FrameSet encode_classic(const Message& message) noexcept;
template <class Message>
[[nodiscard]] CanFrame encode_fd(const Message& message) noexcept;
/// The form that the bus carries.
template <class Message>
[[nodiscard]] FrameSet encode(const Message& message, bool fd) noexcept {
    return fd ? FrameSet(encode_fd(message)) : encode_classic(message);
}

/// Reads one kind of message, classic or FD.
template <class Message>
class MessageDecoder {
public:
    /// `camera`: of ledgers, whose base identifiers differ by camera.
    explicit MessageDecoder(std::uint8_t camera = 0) noexcept;

    /// Writes `out` only when `complete`; of a `not_a_number` CameraCommand or CameraTrigger, counter and
    /// camera(s).
    [[nodiscard]] DecodeStatus accept(const CanFrame& frame, std::int64_t t_reference_ns, Message& out) noexcept;
    [[nodiscard]] std::uint64_t count(DecodeStatus status) const noexcept { return set_.count(status); }

private:
    SetDecoder set_;
};
using LedgerDecoder = MessageDecoder<FrameLedger>;
using EstimateDecoder = MessageDecoder<EstimateReport>;

}  // namespace narpa
