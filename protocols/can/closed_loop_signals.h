/// protocols/can/closed_loop_signals.h - where every quantity of a closed loop lies on the wire (see signals.h).
#pragma once

#include "protocols/can/signals.h"
#include "protocols/closed_loop.h"

namespace narpa {

// --- What the thrusters are to do -------------------------------------------------------------------------------

/// Index of each quantity in the table; components follow each other.
enum ActuatorSignal : std::size_t {
    kActuatorTime = 0,
    kActuatorImpulse = 1,
    kActuatorAngularImpulse = 4,
    kActuatorLeg = 7,
    kActuatorPhase = 8,
    kActuatorAbort = 9,
    kActuatorSignalCount = 10
};

inline constexpr double kImpulseSteps_per_N_s = 1e3;  ///< also of one N m s
inline constexpr auto kGuidancePhaseChoices = numbered(kGuidancePhases);
inline constexpr auto kAbortReasonChoices = numbered(kAbortReasons);

inline constexpr std::array<std::string_view, 5> kActuatorFrames{
    "ActuatorTime", "ActuatorImpulseXY", "ActuatorImpulseZAngX", "ActuatorAngYZ", "ActuatorPhase"};

inline constexpr std::array<Signal, kActuatorSignalCount> kActuatorSignals{{
    {"Time", "ns", "Of force: simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}, {0, 0, 48}},
    {"ImpulseX", "N s", "Force times time, body axes", kImpulseSteps_per_N_s, true, {1, 0, 24}, {0, 48, 24}},
    {"ImpulseY", "N s", "Force times time, body axes", kImpulseSteps_per_N_s, true, {1, 24, 24}, {0, 72, 24}},
    {"ImpulseZ", "N s", "Force times time, body axes", kImpulseSteps_per_N_s, true, {2, 0, 24}, {0, 96, 24}},
    {"AngularImpulseX",
     "N m s",
     "Torque about the centre of mass times time, body axes",
     kImpulseSteps_per_N_s,
     true,
     {2, 24, 24},
     {0, 120, 24}},
    {"AngularImpulseY",
     "N m s",
     "Torque about the centre of mass times time, body axes",
     kImpulseSteps_per_N_s,
     true,
     {3, 0, 24},
     {0, 144, 24}},
    {"AngularImpulseZ",
     "N m s",
     "Torque about the centre of mass times time, body axes",
     kImpulseSteps_per_N_s,
     true,
     {3, 24, 24},
     {0, 168, 24}},
    {"Leg", "", "Index in the scenario", 1, false, {4, 0, 8}, {0, 192, 8}},
    {"Phase", "", "What the navigation is doing", 1, false, {4, 8, 4}, {0, 200, 4}, kGuidancePhaseChoices},
    {"Abort", "", "Why the navigation has given up", 1, false, {4, 12, 4}, {0, 204, 4}, kAbortReasonChoices},
}};

inline constexpr SetLayout kActuatorLayout{"Actuator", "What the thrusters are to do within one control period",
                                           kActuatorFrames, kActuatorSignals, 208};

// --- Where the navigation believes the target -------------------------------------------------------------------

enum NavigationSignal : std::size_t {
    kNavigationTime = 0,
    kNavigationPosition = 1,
    kNavigationAttitude = 4,
    kNavigationSigmaPosition = 8,
    kNavigationSigmaRotation = 11,
    kNavigationCycle = 14,
    kNavigationFrameCount = 15,
    kNavigationSweepCount = 16,
    kNavigationSignalCount = 17
};

inline constexpr std::array<std::string_view, 10> kNavigationFrames{
    "NavigationTime",       "NavigationPositionX",  "NavigationPositionY", "NavigationPositionZ",
    "NavigationAttitudeWX", "NavigationAttitudeYZ", "NavigationSigmaXY",   "NavigationSigmaZRotX",
    "NavigationSigmaRotYZ", "NavigationCycle"};

inline constexpr std::array<Signal, kNavigationSignalCount> kNavigationSignals{{
    {"Time", "ns", "Of validity: simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}, {0, 0, 48}},
    {"PositionX", "m", "Target's origin in the chaser's axes", kPositionSteps_per_m, true, {1, 0, 48}, {0, 48, 48}},
    {"PositionY", "m", "Target's origin in the chaser's axes", kPositionSteps_per_m, true, {2, 0, 48}, {0, 96, 48}},
    {"PositionZ",
     "m",
     "Target's origin in the chaser's axes",
     kPositionSteps_per_m,
     true,
     {3, 0, 48},
     {0, 144, 48}},
    {"AttitudeW", "", "Hamilton quaternion, target to chaser", kAttitudeSteps, true, {4, 0, 24}, {0, 192, 24}},
    {"AttitudeX", "", "Hamilton quaternion, target to chaser", kAttitudeSteps, true, {4, 24, 24}, {0, 216, 24}},
    {"AttitudeY", "", "Hamilton quaternion, target to chaser", kAttitudeSteps, true, {5, 0, 24}, {0, 240, 24}},
    {"AttitudeZ", "", "Hamilton quaternion, target to chaser", kAttitudeSteps, true, {5, 24, 24}, {0, 264, 24}},
    {"SigmaX", "m", "Standard deviation of the position", kPositionSteps_per_m, false, {6, 0, 24}, {0, 288, 24}},
    {"SigmaY", "m", "Standard deviation of the position", kPositionSteps_per_m, false, {6, 24, 24}, {0, 312, 24}},
    {"SigmaZ", "m", "Standard deviation of the position", kPositionSteps_per_m, false, {7, 0, 24}, {0, 336, 24}},
    {"SigmaRotX",
     "rad",
     "Standard deviation of the attitude about the chaser's axis",
     kSigmaRotationSteps_per_rad,
     false,
     {7, 24, 24},
     {0, 360, 24}},
    {"SigmaRotY",
     "rad",
     "Standard deviation of the attitude about the chaser's axis",
     kSigmaRotationSteps_per_rad,
     false,
     {8, 0, 24},
     {0, 384, 24}},
    {"SigmaRotZ",
     "rad",
     "Standard deviation of the attitude about the chaser's axis",
     kSigmaRotationSteps_per_rad,
     false,
     {8, 24, 24},
     {0, 408, 24}},
    {"Cycle", "", "Number of the control period", 1, false, {9, 0, 32}, {0, 432, 32}},
    {"Frames", "", "Camera frames taken since the estimate before", 1, false, {9, 32, 8}, {0, 464, 8}},
    {"Sweeps", "", "LiDAR sweeps taken since the estimate before", 1, false, {9, 40, 8}, {0, 472, 8}},
}};

inline constexpr SetLayout kNavigationLayout{"Navigation",
                                             "The target beside the chaser as the navigation believes it",
                                             kNavigationFrames, kNavigationSignals, 480};

// --- What star tracker and gyroscope measure --------------------------------------------------------------------

enum AttitudeSignal : std::size_t {
    kAttitudeTime = 0,
    kAttitudeQuaternion = 1,
    kAttitudeRate = 5,
    kAttitudeSignalCount = 8
};

inline constexpr double kGyroscopeSteps_per_rad_s = 1e6;

inline constexpr std::array<std::string_view, 5> kAttitudeFrames{"AttitudeTime", "AttitudeWX", "AttitudeYZ",
                                                                 "AttitudeRateXY", "AttitudeRateZ"};

inline constexpr std::array<Signal, kAttitudeSignalCount> kAttitudeSignals{{
    {"Time", "ns", "Of the measurement: simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}, {0, 0, 48}},
    {"AttitudeW", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {1, 0, 24}, {0, 48, 24}},
    {"AttitudeX", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {1, 24, 24}, {0, 72, 24}},
    {"AttitudeY", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {2, 0, 24}, {0, 96, 24}},
    {"AttitudeZ", "", "Hamilton quaternion, chaser to world", kAttitudeSteps, true, {2, 24, 24}, {0, 120, 24}},
    {"RateX", "rad/s", "Angular rate in body axes", kGyroscopeSteps_per_rad_s, true, {3, 0, 24}, {0, 144, 24}},
    {"RateY", "rad/s", "Angular rate in body axes", kGyroscopeSteps_per_rad_s, true, {3, 24, 24}, {0, 168, 24}},
    {"RateZ", "rad/s", "Angular rate in body axes", kGyroscopeSteps_per_rad_s, true, {4, 0, 24}, {0, 192, 24}},
}};

inline constexpr SetLayout kAttitudeLayout{"Attitude", "What the chaser's star tracker and gyroscope measure",
                                           kAttitudeFrames, kAttitudeSignals, 216};

// --- What the dynamics are doing --------------------------------------------------------------------------------

enum DynamicsSignal : std::size_t { kDynamicsTime, kDynamicsStart, kDynamicsPhase, kDynamicsSignalCount };

inline constexpr auto kDynamicsPhaseChoices = numbered(kDynamicsPhases);

inline constexpr std::array<std::string_view, 3> kDynamicsFrames{"DynamicsTime", "DynamicsStart", "DynamicsPhase"};

inline constexpr std::array<Signal, kDynamicsSignalCount> kDynamicsSignals{{
    {"Time", "ns", "Simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}, {0, 0, 48}},
    {"Start", "ns", "The scenario's time 0: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}, {0, 48, 48}},
    {"Phase", "", "What the dynamics are doing", 1, false, {2, 0, 4}, {0, 96, 4}, kDynamicsPhaseChoices},
}};

inline constexpr SetLayout kDynamicsLayout{"Dynamics", "Before the pose commands of the same time", kDynamicsFrames,
                                           kDynamicsSignals, 104};

}  // namespace narpa
