/// protocols/can/messages.h - what is said on CAN: pose commands in; heartbeat, frame ledgers and estimates out.
///
/// Wire layout: signals.h and README.md; the same tables make narpa.dbc. Nothing here allocates (except texts of
/// errors), blocks or throws.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/pose.h"
#include "base/result.h"
#include "protocols/can/frame.h"
#include "protocols/can/signal_set.h"
#include "protocols/estimate.h"
#include "protocols/ledger_fields.h"

namespace narpa {

// --- Pose command -----------------------------------------------------------------------------------------------

struct PoseCommand {
    std::uint8_t counter = 0;     ///< +1 with every command of a body, wraps
    std::int64_t t_valid_ns = 0;  ///< simulation clock; 48 bits of it travel
    Motion motion{};              ///< attitude: | |q| - 1 | <= 1e-3
};

/// Base identifiers of bodies are multiples of 16 from 0x000 to 0x5F0; telemetry lies above.
inline constexpr std::uint32_t kMaxBodyBaseId = 0x5F0;
/// An Error (bad_input, without file) that says what is wrong with a body's `can_id`.
Status check_body_base_id(std::int64_t can_id);

/// Which quantity does not fit the wire; `operator bool` is true when all did.
struct EncodeStatus {
    std::string_view quantity{};  ///< signal name of signals.h, or "AttitudeNorm"; empty: all is well
    std::string_view unit{};
    double value = 0, min = 0, max = 0;

    explicit operator bool() const noexcept { return quantity.empty(); }
    /// "VelocityX = 12000 m/s is outside -10737.4 .. 10737.4 m/s".
    [[nodiscard]] std::string text() const;
};

using PoseFrames = std::array<CanFrame, kPoseFrames.size()>;

/// The nine classic frames at base_id + 0 .. 8. Leaves `out` as it was unless the status is good.
[[nodiscard]] EncodeStatus encode_classic(const PoseCommand& command, std::uint32_t base_id,
                                          PoseFrames& out) noexcept;
/// The one CAN FD frame at base_id + 15, in the same steps.
[[nodiscard]] EncodeStatus encode_fd(const PoseCommand& command, std::uint32_t base_id, CanFrame& out) noexcept;

using PoseStatus = DecodeStatus;

/// Reads the pose commands of one body, classic or FD. One for each body; fixed size.
class PoseDecoder {
public:
    explicit PoseDecoder(std::uint32_t base_id) noexcept;

    /// `t_reference_ns` (simulation clock, within 39 h of the command) tells which turn of the 48-bit time is
    /// meant. Writes `out`, with its quaternion normalised, only when the status is `complete`. Whether a command
    /// comes too late in time is for the receiver to judge. `incomplete_set` is never returned, only counted: see
    /// SetDecoder.
    [[nodiscard]] PoseStatus accept(const CanFrame& frame, std::int64_t t_reference_ns, PoseCommand& out) noexcept;

    [[nodiscard]] std::uint32_t base_id() const noexcept { return set_.base_id(); }
    [[nodiscard]] std::uint64_t count(PoseStatus status) const noexcept { return set_.count(status); }

private:
    SetDecoder set_;
};

// --- Heartbeat --------------------------------------------------------------------------------------------------

inline constexpr std::uint32_t kHeartbeatId = 0x701;  ///< CiA 301: 0x700 + node identifier 1

enum class RunState : std::uint8_t { starting, running, lockstep, stopping };

struct Heartbeat {
    std::int64_t t_ns = 0;  ///< simulation clock; whole microseconds travel
    RunState state = RunState::starting;
    bool no_command = false, stale = false, deadline_missed = false, output_dropped = false;
    std::uint8_t counter = 0;  ///< +1 with every heartbeat, wraps
    friend bool operator==(const Heartbeat&, const Heartbeat&) = default;
};

[[nodiscard]] CanFrame encode(const Heartbeat& heartbeat) noexcept;
/// Writes `out` only when the status is `complete`.
[[nodiscard]] DecodeStatus decode(const CanFrame& frame, std::int64_t t_reference_ns, Heartbeat& out) noexcept;

// --- Frame ledger -----------------------------------------------------------------------------------------------

inline constexpr std::uint32_t kTelemetryBaseId = 0x600;
inline constexpr std::uint8_t kMaxTelemetryCameras = 16;
/// Each camera has a base identifier of its own: 0x600, 0x610, ...
[[nodiscard]] constexpr std::uint32_t ledger_base_id(std::uint8_t camera) noexcept {
    return kTelemetryBaseId + kBaseIdStep * (camera % kMaxTelemetryCameras);
}

using LedgerFrames = std::array<CanFrame, kLedgerFrames.size()>;

/// Ten classic frames at ledger_base_id(camera) + 0 .. 9; counter = low 8 bits of the frame number. Times other
/// than exposure mid and pose time travel as whole microseconds after exposure mid and saturate at 8.388607 s,
/// counts saturate at 2^40 - 1. Of the passes their number travels, not what each took: that is in the log.
[[nodiscard]] LedgerFrames encode_classic(const FrameLedger& ledger) noexcept;
/// One CAN FD frame at ledger_base_id(camera) + 15 with the same quantities.
[[nodiscard]] CanFrame encode_fd(const FrameLedger& ledger) noexcept;

/// Reads the ledgers of one camera, classic or FD.
class LedgerDecoder {
public:
    explicit LedgerDecoder(std::uint8_t camera = 0) noexcept;

    /// Writes `out` only when the status is `complete`.
    [[nodiscard]] DecodeStatus accept(const CanFrame& frame, std::int64_t t_reference_ns,
                                      FrameLedger& out) noexcept;
    [[nodiscard]] std::uint64_t count(DecodeStatus status) const noexcept { return set_.count(status); }

private:
    SetDecoder set_;
};

// --- Estimate ---------------------------------------------------------------------------------------------------

inline constexpr std::uint32_t kEstimateBaseId = 0x710;

using EstimateFrames = std::array<CanFrame, kEstimateFrames.size()>;

/// Ten classic frames at kEstimateBaseId + 0 .. 9; counter = low 8 bits of the frame number. Standard deviations
/// saturate at 16.777215 m and 1.6777215 rad, positions at their range; of a state `lost` pose and deviations are
/// "not available", and saturated.
[[nodiscard]] EstimateFrames encode_classic(const EstimateReport& estimate) noexcept;
/// One CAN FD frame at kEstimateBaseId + 15 with the same quantities.
[[nodiscard]] CanFrame encode_fd(const EstimateReport& estimate) noexcept;

/// Reads estimates, classic or FD.
class EstimateDecoder {
public:
    EstimateDecoder() noexcept;

    /// Writes `out` only when the status is `complete`; of a state `lost` only frame, camera, state and time.
    [[nodiscard]] DecodeStatus accept(const CanFrame& frame, std::int64_t t_reference_ns,
                                      EstimateReport& out) noexcept;
    [[nodiscard]] std::uint64_t count(DecodeStatus status) const noexcept { return set_.count(status); }

private:
    SetDecoder set_;
};

}  // namespace narpa
