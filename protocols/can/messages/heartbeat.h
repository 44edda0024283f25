/// protocols/can/messages/heartbeat.h - narpa is alive: one classic frame, on CAN FD too.
#pragma once

#include "protocols/can/codec.h"

namespace narpa {

enum class RunState : std::uint8_t { starting, running, lockstep, stopping };

struct Heartbeat {
    std::int64_t t_ns = 0;  ///< simulation clock; sent in whole microseconds
    RunState state = RunState::starting;
    bool no_command = false, stale = false, deadline_missed = false, output_dropped = false;
    std::uint8_t counter = 0;  ///< +1 with every heartbeat, wraps
    friend bool operator==(const Heartbeat&, const Heartbeat&) = default;
};

inline constexpr std::uint32_t kHeartbeatId = 0x701;             ///< CiA 301: 0x700 + node identifier 1
inline constexpr std::int64_t kHeartbeatPeriodNs = 100'000'000;  ///< in real time; in lockstep one per command

inline constexpr std::array<Choice, 4> kRunStates{
    {{0, "starting"}, {1, "running"}, {2, "lockstep"}, {3, "stopping"}}};
inline constexpr std::array<std::string_view, 1> kHeartbeatFrames{"Heartbeat"};

inline constexpr auto kHeartbeatSignals = std::to_array<Signal>({
    {"Time", "us", "Simulation clock modulo 2^40 us", 1, false, {0, 0, 40}},
    {"State", "", "State of the emulator", 1, false, {0, 40, 4}, {}, kRunStates},
    {"NoCommand", "", "A commanded body never had a command", 1, false, {0, 44, 1}},
    {"Stale", "", "A commanded body's last command is too old", 1, false, {0, 45, 1}},
    {"DeadlineMissed", "", "A frame was late since the last heartbeat", 1, false, {0, 46, 1}},
    {"OutputDropped", "", "An output dropped data since the last heartbeat", 1, false, {0, 47, 1}},
});

inline constexpr SetLayout kHeartbeatLayout{"Heartbeat", "heartbeat",      "narpa is alive", kHeartbeatId,
                                            kFromNarpa,  kHeartbeatFrames, kHeartbeatSignals};

template <>
struct Codec<Heartbeat> {
    static constexpr const SetLayout& layout = kHeartbeatLayout;
    static void fields(auto& m, const auto& each) noexcept {
        each(m.t_ns, m.state, m.no_command, m.stale, m.deadline_missed, m.output_dropped);
    }
};

/// The heartbeat's one frame, at kHeartbeatId.
[[nodiscard]] inline CanFrame encode(const Heartbeat& heartbeat) noexcept {
    return encode_classic(heartbeat)[0];
}
/// Writes `out` only when the status is `complete`.
[[nodiscard]] inline DecodeStatus decode(const CanFrame& frame, std::int64_t t_reference_ns,
                                         Heartbeat& out) noexcept {
    return MessageDecoder<Heartbeat>().accept(frame, t_reference_ns, out);
}

}  // namespace narpa
