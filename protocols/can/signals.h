/// protocols/can/signals.h - where every quantity lies on the wire: the tables that encode, decode and the DBC
/// share.
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

#include "protocols/camera_control.h"
#include "protocols/can/identifiers.h"
#include "protocols/closed_loop.h"
#include "protocols/estimate.h"

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

struct SetLayout {
    std::string_view name{};  ///< name of the CAN FD message
    std::string_view comment{};
    std::span<const std::string_view> frames{};  ///< names of the classic messages, at base + index
    std::span<const Signal> signals{};
    std::uint16_t fd_counter_bit = 0;  ///< where the counter lies in the FD frame; 0: no FD form
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

inline constexpr std::size_t kClassicBytes = 8, kFdBytes = 64;
inline constexpr int kClassicPayloadBits = 48;
inline constexpr int kClassicCounterByte = 6, kClassicCrcByte = 7, kFdCrcByte = 62;

// --- Pose command: base identifier = the body's can_id ----------------------------------------------------------

inline constexpr double kPositionSteps_per_m = 1e6;
inline constexpr double kAttitudeSteps = 4194304.0;  ///< 2^22: 1 and -1 fit exactly
inline constexpr double kVelocitySteps_per_m_s = 5e4;
inline constexpr double kRateSteps_per_rad_s = 5e4;

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

inline constexpr SetLayout kPoseLayout{
    "Pose", "Commanded pose: on classic CAN the nine frames of one counter take effect together", kPoseFrames,
    kPoseSignals, 456};

// --- Telemetry: the pose that narpa estimates from its own frames -----------------------------------------------

inline constexpr double kSigmaRotationSteps_per_rad = 1e7;
inline constexpr auto kEstimateStateChoices = numbered(kEstimateStates);
inline constexpr auto kAnswerChoices = numbered(kAnswerKinds);

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

inline constexpr std::array<std::string_view, 10> kEstimateFrames{
    "EstimateTime",       "EstimatePositionX", "EstimatePositionY",  "EstimatePositionZ",  "EstimateAttitudeWX",
    "EstimateAttitudeYZ", "EstimateSigmaXY",   "EstimateSigmaZRotX", "EstimateSigmaRotYZ", "EstimateState"};

inline constexpr auto kEstimateSignals = place_fd_signals(
    pose_signals("Middle of the exposure: simulation clock modulo 2^48 ns", "Target's origin in camera axes",
                 "Hamilton quaternion, target to camera"),
    sigma_signals("Standard deviation of the attitude about the camera's axis"),
    std::to_array<Signal>({
        {"Frame", "", "Number of the frame that it was estimated from", 1, false, {9, 0, 32}},
        {"Camera", "", "Index of the camera in the scene", 1, false, {9, 32, 8}},
        {"State", "", "Source of the estimate", 1, false, {9, 40, 3}, {}, kEstimateStateChoices},
        {"Answer", "", "Class of the pose estimated from the frame", 1, false, {9, 43, 3}, {}, kAnswerChoices},
    }));

inline constexpr SetLayout kEstimateLayout{"Estimate",
                                           "Pose of the target that narpa estimates from its own frames",
                                           kEstimateFrames, kEstimateSignals, 480};

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

inline constexpr SetLayout kHeartbeatLayout{"Heartbeat", "narpa is alive", kHeartbeatFrames, kHeartbeatSignals, 0};

// --- Commands to the thrusters -------------------------------------------------------------------------------

inline constexpr double kImpulseSteps_per_N_s = 1e3;  ///< also of one N m s
inline constexpr std::string_view kTorqueTimesTime = "Torque about the centre of mass times time, body axes";
inline constexpr auto kGuidancePhaseChoices = numbered(kGuidancePhases);
inline constexpr auto kAbortReasonChoices = numbered(kAbortReasons);

inline constexpr std::array<std::string_view, 5> kActuatorFrames{
    "ActuatorTime", "ActuatorImpulseXY", "ActuatorImpulseZAngX", "ActuatorAngYZ", "ActuatorPhase"};

inline constexpr auto kActuatorSignals = place_fd_signals(std::to_array<Signal>({
    {"Time", "ns", "Start of the force: simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}},
    {"ImpulseX", "N s", "Force times time, body axes", kImpulseSteps_per_N_s, true, {1, 0, 24}},
    {"ImpulseY", "N s", "Force times time, body axes", kImpulseSteps_per_N_s, true, {1, 24, 24}},
    {"ImpulseZ", "N s", "Force times time, body axes", kImpulseSteps_per_N_s, true, {2, 0, 24}},
    {"AngularImpulseX", "N m s", kTorqueTimesTime, kImpulseSteps_per_N_s, true, {2, 24, 24}},
    {"AngularImpulseY", "N m s", kTorqueTimesTime, kImpulseSteps_per_N_s, true, {3, 0, 24}},
    {"AngularImpulseZ", "N m s", kTorqueTimesTime, kImpulseSteps_per_N_s, true, {3, 24, 24}},
    {"Leg", "", "Index in the scenario", 1, false, {4, 0, 8}},
    {"Phase", "", "Guidance phase of the navigation", 1, false, {4, 8, 4}, {}, kGuidancePhaseChoices},
    {"Abort", "", "Reason for the navigation's abort", 1, false, {4, 12, 4}, {}, kAbortReasonChoices},
}));

inline constexpr SetLayout kActuatorLayout{"Actuator", "Commanded impulses of one control period", kActuatorFrames,
                                           kActuatorSignals, 208};

// --- The navigation's estimate of the target ----------------------------------------------------------------

inline constexpr std::array<std::string_view, 10> kNavigationFrames{
    "NavigationTime",       "NavigationPositionX",  "NavigationPositionY", "NavigationPositionZ",
    "NavigationAttitudeWX", "NavigationAttitudeYZ", "NavigationSigmaXY",   "NavigationSigmaZRotX",
    "NavigationSigmaRotYZ", "NavigationCycle"};

inline constexpr auto kNavigationSignals =
    place_fd_signals(pose_signals("Time of validity: simulation clock modulo 2^48 ns",
                                  "Target's origin in the chaser's axes", "Hamilton quaternion, target to chaser"),
                     sigma_signals("Standard deviation of the attitude about the chaser's axis"),
                     std::to_array<Signal>({
                         {"Cycle", "", "Number of the control period", 1, false, {9, 0, 32}},
                         {"Frames", "", "Camera frames used since the previous estimate", 1, false, {9, 32, 8}},
                         {"Sweeps", "", "LiDAR sweeps used since the previous estimate", 1, false, {9, 40, 8}},
                     }));

inline constexpr SetLayout kNavigationLayout{"Navigation",
                                             "Target relative to the chaser, estimated by the navigation",
                                             kNavigationFrames, kNavigationSignals, 480};

// --- Star tracker and gyroscope --------------------------------------------------------------------

inline constexpr double kGyroscopeSteps_per_rad_s = 1e6;

inline constexpr std::array<std::string_view, 5> kAttitudeFrames{"AttitudeTime", "AttitudeWX", "AttitudeYZ",
                                                                 "AttitudeRateXY", "AttitudeRateZ"};

inline constexpr auto kAttitudeSignals = place_fd_signals(std::to_array<Signal>({
    {"Time", "ns", "Time of the measurement: simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}},
    {"AttitudeW", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {1, 0, 24}},
    {"AttitudeX", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {1, 24, 24}},
    {"AttitudeY", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {2, 0, 24}},
    {"AttitudeZ", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {2, 24, 24}},
    {"RateX", "rad/s", "Angular rate in body axes", kGyroscopeSteps_per_rad_s, true, {3, 0, 24}},
    {"RateY", "rad/s", "Angular rate in body axes", kGyroscopeSteps_per_rad_s, true, {3, 24, 24}},
    {"RateZ", "rad/s", "Angular rate in body axes", kGyroscopeSteps_per_rad_s, true, {4, 0, 24}},
}));

inline constexpr SetLayout kAttitudeLayout{"Attitude", "Measurements of the chaser's star tracker and gyroscope",
                                           kAttitudeFrames, kAttitudeSignals, 216};

// --- State of the dynamics --------------------------------------------------------------------------------

inline constexpr auto kDynamicsPhaseChoices = numbered(kDynamicsPhases);

inline constexpr std::array<std::string_view, 3> kDynamicsFrames{"DynamicsTime", "DynamicsStart", "DynamicsPhase"};

inline constexpr auto kDynamicsSignals = place_fd_signals(std::to_array<Signal>({
    {"Time", "ns", "Simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}},
    {"Start", "ns", "The scenario's time 0: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}},
    {"Phase", "", "State of the dynamics", 1, false, {2, 0, 4}, {}, kDynamicsPhaseChoices},
}));

inline constexpr SetLayout kDynamicsLayout{"Dynamics",
                                           "State of the dynamics: sent before the pose commands of the same time",
                                           kDynamicsFrames, kDynamicsSignals, 104};

// --- Cameras that are operated while they run -------------------------------------------------------------------

inline constexpr double kGainSteps_per_dB = 100;
inline constexpr auto kOffOnChoices = std::to_array<Choice>({{0, "off"}, {1, "on"}});
inline constexpr auto kTriggerModeChoices = numbered(kTriggerModes);
inline constexpr auto kCameraAnswerChoices = numbered(kCameraAnswers);

/// The settings of a camera, in classic frames from `first` on. In a command, signals may be "not available".
[[nodiscard]] constexpr std::array<Signal, 11> camera_setting_signals(std::uint8_t first) {
    const auto at = [&](int frame) { return static_cast<std::uint8_t>(first + frame); };
    return {{
        {"Running", "", "Whether frames are exposed", 1, true, {at(0), 0, 8}, {}, kOffOnChoices},
        {"Trigger", "", "Source of the exposure's start", 1, true, {at(0), 8, 8}, {}, kTriggerModeChoices},
        {"AutoExposure", "", "Automatic exposure time", 1, true, {at(0), 16, 8}, {}, kOffOnChoices},
        {"Binning", "", "n: blocks of n x n pixels have their mean", 1, true, {at(0), 24, 8}},
        {"Gain", "dB", "Factor on the gain of the scene's detector", kGainSteps_per_dB, true, {at(0), 32, 16}},
        {"Exposure", "ns", "Exposure time of one row", 1, true, {at(1), 0, 48}},
        {"RegionX", "px", "First column that is read out", 1, true, {at(2), 0, 24}},
        {"RegionY", "px", "First row that is read out", 1, true, {at(2), 24, 24}},
        {"RegionWidth", "px", "Columns that are read out", 1, true, {at(3), 0, 24}},
        {"RegionHeight", "px", "Rows that are read out", 1, true, {at(3), 24, 24}},
        {"Period", "ns", "Time between frames; minimum time between triggers", 1, true, {at(4), 0, 48}},
    }};
}

inline constexpr std::array<std::string_view, 6> kCameraCommandFrames{
    "CameraCommandCamera",   "CameraCommandSwitches", "CameraCommandExposure",
    "CameraCommandRegionXY", "CameraCommandRegionWH", "CameraCommandPeriod"};
inline constexpr auto kCameraCommandSignals = place_fd_signals(
    std::to_array<Signal>({{"Camera", "", "Index of the camera in the scene", 1, false, {0, 0, 8}}}),
    camera_setting_signals(1));
inline constexpr SetLayout kCameraCommandLayout{"CameraCommand",
                                                "Changes a camera's settings; not available: unchanged",
                                                kCameraCommandFrames, kCameraCommandSignals, 248};

inline constexpr std::array<std::string_view, 2> kCameraTriggerFrames{"CameraTriggerCameras", "CameraTriggerTime"};
inline constexpr auto kCameraTriggerSignals = place_fd_signals(std::to_array<Signal>({
    {"Cameras", "", "Bit i: camera i of the scene", 1, false, {0, 0, 16}},
    {"AtOnce", "", "As soon as possible, instead of at Time", 1, false, {0, 16, 8}, {}, kOffOnChoices},
    {"Time", "ns", "Start of the exposure: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}},
}));
inline constexpr SetLayout kCameraTriggerLayout{"CameraTrigger",
                                                "Exposes one frame of each camera named, at the same time",
                                                kCameraTriggerFrames, kCameraTriggerSignals, 72};

inline constexpr std::array<std::string_view, 2> kCameraReplyFrames{"CameraReplyAnswer", "CameraReplyTime"};
inline constexpr auto kCameraReplySignals = place_fd_signals(std::to_array<Signal>({
    {"Camera", "", "Index of the camera in the scene", 1, false, {0, 0, 8}},
    {"ToTrigger", "", "The reply is to a trigger, not to a command", 1, false, {0, 8, 8}, {}, kOffOnChoices},
    {"Answer", "", "Accepted, or the reason for refusal", 1, false, {0, 16, 8}, {}, kCameraAnswerChoices},
    {"Time",
     "ns",
     "First time of the settings, or start of the exposure: simulation clock modulo 2^48 ns",
     1,
     false,
     {1, 0, 48}},
}));
inline constexpr SetLayout kCameraReplyLayout{"CameraReply", "Counter: that of the command or trigger",
                                              kCameraReplyFrames, kCameraReplySignals, 72};

inline constexpr std::array<std::string_view, 6> kCameraStateFrames{"CameraStateFrame",    "CameraStateSwitches",
                                                                    "CameraStateExposure", "CameraStateRegionXY",
                                                                    "CameraStateRegionWH", "CameraStatePeriod"};
inline constexpr auto kCameraStateSignals =
    place_fd_signals(std::to_array<Signal>({
                         {"Frame", "", "Frame number", 1, false, {0, 0, 32}},
                         {"Camera", "", "Index of the camera in the scene", 1, false, {0, 32, 8}},
                         {"CommandCounter", "", "Counter of the newest command in effect", 1, false, {0, 40, 8}},
                     }),
                     camera_setting_signals(1));
inline constexpr SetLayout kCameraStateLayout{"CameraState", "Settings with which a frame was taken",
                                              kCameraStateFrames, kCameraStateSignals, 288};

// --- LiDARs whose shots go over CAN: velocimeters, altimeters ---------------------------------------------------

inline constexpr std::array<std::string_view, 4> kLidarBeamFrames{"LidarBeamNumber", "LidarBeamTime",
                                                                  "LidarBeamRange", "LidarBeamVelocity"};
inline constexpr auto kLidarBeamSignals = place_fd_signals(std::to_array<Signal>({
    {"Lidar", "", "Index of the LiDAR in the scene", 1, false, {0, 0, 8}},
    {"Beam", "", "Number of the beam", 1, false, {0, 8, 16}},
    {"Time", "ns", "Time of the shot: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}},
    {"Range", "m", "Range along the beam; not available: no echo", 1e6, true, {2, 0, 48}},
    {"Velocity", "m/s", "Radial velocity, receding is positive; not available: none", 1e6, true, {3, 0, 48}},
}));
inline constexpr SetLayout kLidarBeamLayout{"LidarBeam", "Measurement of one shot of a LiDAR", kLidarBeamFrames,
                                            kLidarBeamSignals, 168};

}  // namespace narpa
