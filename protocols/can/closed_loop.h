/// protocols/can/closed_loop.h - what dynamics and navigation say to each other on CAN, in sets as all others are.
///
/// Wire layout: closed_loop_signals.h and README.md. Nothing here allocates, blocks or throws.
#pragma once

#include <array>
#include <cstdint>

#include "protocols/can/closed_loop_signals.h"
#include "protocols/can/frame.h"
#include "protocols/can/signal_set.h"
#include "protocols/closed_loop.h"

namespace narpa {

inline constexpr std::uint32_t kActuatorBaseId = 0x720;
inline constexpr std::uint32_t kNavigationBaseId = 0x730;
inline constexpr std::uint32_t kAttitudeBaseId = 0x740;
inline constexpr std::uint32_t kDynamicsBaseId = 0x750;

using ActuatorFrames = std::array<CanFrame, kActuatorFrames.size()>;
using NavigationFrames = std::array<CanFrame, kNavigationFrames.size()>;
using AttitudeFrames = std::array<CanFrame, kAttitudeFrames.size()>;
using DynamicsFrames = std::array<CanFrame, kDynamicsFrames.size()>;

/// Impulses saturate at 8388.607 N s (N m s); of numbers that are not finite the signal is "not available".
[[nodiscard]] ActuatorFrames encode_classic(const ActuatorCommand& command) noexcept;
[[nodiscard]] CanFrame encode_fd(const ActuatorCommand& command) noexcept;
/// As the estimate's: deviations and positions saturate. Counter = low 8 bits of the cycle.
[[nodiscard]] NavigationFrames encode_classic(const NavigationEstimate& estimate) noexcept;
[[nodiscard]] CanFrame encode_fd(const NavigationEstimate& estimate) noexcept;
[[nodiscard]] AttitudeFrames encode_classic(const AttitudeReport& report) noexcept;
[[nodiscard]] CanFrame encode_fd(const AttitudeReport& report) noexcept;
[[nodiscard]] DynamicsFrames encode_classic(const DynamicsReport& report) noexcept;
[[nodiscard]] CanFrame encode_fd(const DynamicsReport& report) noexcept;

/// Reads one of the four kinds of message, classic or FD: ActuatorCommand, NavigationEstimate, AttitudeReport,
/// DynamicsReport.
template <class Message>
class MessageDecoder {
public:
    MessageDecoder() noexcept;

    /// Writes `out` only when the status is `complete`.
    [[nodiscard]] DecodeStatus accept(const CanFrame& frame, std::int64_t t_reference_ns, Message& out) noexcept;
    [[nodiscard]] std::uint64_t count(DecodeStatus status) const noexcept { return set_.count(status); }

private:
    SetDecoder set_;
};

}  // namespace narpa
