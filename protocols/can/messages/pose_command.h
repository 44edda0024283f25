/// protocols/can/messages/pose_command.h - the commanded pose of a body, at the body's can_id.
#pragma once

#include "protocols/can/codec.h"

namespace narpa {

struct PoseCommand {
    std::uint8_t counter = 0;     ///< +1 with every command of a body, wraps
    std::int64_t t_valid_ns = 0;  ///< simulation clock; its low 48 bits are sent
    Motion motion{};              ///< attitude: | |q| - 1 | <= 1e-3
};

inline constexpr double kVelocitySteps_per_m_s = 5e4;
inline constexpr double kRateSteps_per_rad_s = 5e4;

inline constexpr std::array<std::string_view, 9> kPoseFrames{
    "Time", "PositionX", "PositionY", "PositionZ", "AttitudeWX", "AttitudeYZ", "MotionX", "MotionY", "MotionZ"};

inline constexpr auto kPoseSignals = place_fd_signals(
    pose_signals("Time of validity: simulation clock modulo 2^48 ns", "Body origin in world axes",
                 "Hamilton quaternion, body to world"),
    std::to_array<Signal>({
        {"VelocityX", "m/s", "Velocity in world axes", kVelocitySteps_per_m_s, true, {6, 0, 30}, {0, 0, 32}},
        {"VelocityY", "m/s", "Velocity in world axes", kVelocitySteps_per_m_s, true, {7, 0, 30}, {0, 0, 32}},
        {"VelocityZ", "m/s", "Velocity in world axes", kVelocitySteps_per_m_s, true, {8, 0, 30}, {0, 0, 32}},
        {"RateX", "rad/s", "Angular rate in body axes", kRateSteps_per_rad_s, true, {6, 30, 18}, {0, 0, 24}},
        {"RateY", "rad/s", "Angular rate in body axes", kRateSteps_per_rad_s, true, {7, 30, 18}, {0, 0, 24}},
        {"RateZ", "rad/s", "Angular rate in body axes", kRateSteps_per_rad_s, true, {8, 30, 18}, {0, 0, 24}},
    }));

inline constexpr SetLayout kPoseLayout = describe_set(
    "Pose", "pose", "Commanded pose: on classic CAN the nine frames of one counter take effect together", 0,
    kToNarpa, kPoseFrames, kPoseSignals, Instances::per_body);

template <>
struct Codec<PoseCommand> {
    static constexpr const SetLayout& layout = kPoseLayout;
    static void fields(auto& m, const auto& each) noexcept { each(m.t_valid_ns, m.motion); }
};
using PoseStatus = DecodeStatus;
using PoseDecoder = MessageDecoder<PoseCommand>;

/// The nine classic frames at base_id + 0 .. 8. Leaves `out` as it was unless the status is good.
[[nodiscard]] EncodeStatus encode_classic(const PoseCommand& command, std::uint32_t base_id,
                                          FrameSet& out) noexcept;
/// The one CAN FD frame at base_id + 15, in the same steps.
[[nodiscard]] EncodeStatus encode_fd(const PoseCommand& command, std::uint32_t base_id, CanFrame& out) noexcept;
/// The form that the bus carries.
[[nodiscard]] EncodeStatus encode(const PoseCommand& command, std::uint32_t base_id, bool fd,
                                  FrameSet& out) noexcept;

}  // namespace narpa
