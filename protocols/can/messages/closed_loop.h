/// protocols/can/messages/closed_loop.h - the messages between dynamics and navigation.
#pragma once

#include "protocols/can/codec.h"
#include "protocols/closed_loop.h"

namespace narpa {

inline constexpr Route kFromNavigation{"Navigation", "Commander"}, kToNavigation{"Commander", "Navigation"};
inline constexpr std::uint32_t kActuatorBaseId = 0x720, kNavigationBaseId = 0x730;  ///< from navigation
inline constexpr std::uint32_t kAttitudeBaseId = 0x740, kDynamicsBaseId = 0x750;    ///< from dynamics

// --- Commands to the thrusters
// ------------------------------------------------------------------------------------

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

inline constexpr SetLayout kActuatorLayout =
    describe_set("Actuator", "thruster command", "Commanded impulses of one control period", kActuatorBaseId,
                 kFromNavigation, kActuatorFrames, kActuatorSignals);

template <>
struct Codec<ActuatorCommand> {
    static constexpr const SetLayout& layout = kActuatorLayout;
    static void fields(auto& m, const auto& each) noexcept {
        each(m.t_ns, m.impulse_n_s, m.angular_impulse_n_m_s, m.leg, m.phase, m.abort);
    }
};

// --- The navigation's estimate of the target ---------------------------------------------------------------------

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

inline constexpr SetLayout kNavigationLayout =
    describe_set("Navigation", "navigation estimate", "Target relative to the chaser, estimated by the navigation",
                 kNavigationBaseId, kFromNavigation, kNavigationFrames, kNavigationSignals);

template <>
struct Codec<NavigationEstimate> {
    static constexpr const SetLayout& layout = kNavigationLayout;
    static auto& counter(auto& m) noexcept { return m.cycle; }
    static void fields(auto& m, const auto& each) noexcept {
        each(m.t_ns, m.T_chaser_target, m.sigma_position_m, m.sigma_rotation_rad, m.cycle, m.frames, m.sweeps);
    }
};

// --- Star tracker and gyroscope
// -----------------------------------------------------------------------------------

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

inline constexpr SetLayout kAttitudeLayout =
    describe_set("Attitude", "attitude report", "Measurements of the chaser's star tracker and gyroscope",
                 kAttitudeBaseId, kToNavigation, kAttitudeFrames, kAttitudeSignals);

template <>
struct Codec<AttitudeReport> {
    static constexpr const SetLayout& layout = kAttitudeLayout;
    static void fields(auto& m, const auto& each) noexcept { each(m.t_ns, m.q_world_chaser, m.rate_rad_s); }
};

// --- State of the dynamics
// ----------------------------------------------------------------------------------------

inline constexpr auto kDynamicsPhaseChoices = numbered(kDynamicsPhases);

inline constexpr std::array<std::string_view, 3> kDynamicsFrames{"DynamicsTime", "DynamicsStart", "DynamicsPhase"};

inline constexpr auto kDynamicsSignals = place_fd_signals(std::to_array<Signal>({
    {"Time", "ns", "Simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}},
    {"Start", "ns", "The scenario's time 0: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}},
    {"Phase", "", "State of the dynamics", 1, false, {2, 0, 4}, {}, kDynamicsPhaseChoices},
}));

inline constexpr SetLayout kDynamicsLayout = describe_set(
    "Dynamics", "dynamics report", "State of the dynamics: sent before the pose commands of the same time",
    kDynamicsBaseId, kToNavigation, kDynamicsFrames, kDynamicsSignals);

template <>
struct Codec<DynamicsReport> {
    static constexpr const SetLayout& layout = kDynamicsLayout;
    static void fields(auto& m, const auto& each) noexcept { each(m.t_ns, m.t_start_ns, m.phase); }
};

}  // namespace narpa
