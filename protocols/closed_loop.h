/// protocols/closed_loop.h - the messages between dynamics and navigation in a closed loop.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "base/pose.h"

namespace narpa {

/// State of the dynamics.
enum class DynamicsPhase : std::uint8_t {
    flying,
    captured,      ///< contact within the envelope: the docking system holds
    bounced,       ///< contact outside the envelope: the bodies separate again
    finished,      ///< the run is over; the last report
    touched_down,  ///< a foot of the lander has met the ground
    landed,        ///< the lander stands still on its feet
    crashed,       ///< too hard for the landing gear, or tipped over
};
inline constexpr std::array<std::string_view, 7> kDynamicsPhases{"flying",       "captured", "bounced", "finished",
                                                                 "touched_down", "landed",   "crashed"};

/// The chaser has met the target, or the ground.
[[nodiscard]] constexpr bool is_contact(DynamicsPhase phase) noexcept {
    return phase == DynamicsPhase::captured || phase == DynamicsPhase::bounced ||
           phase == DynamicsPhase::touched_down;
}
/// It stays there: docked, or landed.
[[nodiscard]] constexpr bool is_held(DynamicsPhase phase) noexcept {
    return phase == DynamicsPhase::captured || phase == DynamicsPhase::landed;
}

/// Sent before the pose commands of the same time, at every control period and when the phase changes.
struct DynamicsReport {
    std::uint8_t counter = 0;     ///< +1 with every one, wraps
    std::int64_t t_ns = 0;        ///< simulation clock
    std::int64_t t_start_ns = 0;  ///< the scenario's time 0 on that clock
    DynamicsPhase phase = DynamicsPhase::flying;
};

/// Measurements of the chaser's star tracker and gyroscope.
struct AttitudeReport {
    std::uint8_t counter = 0;
    std::int64_t t_ns = 0;
    Quat q_world_chaser{};
    Vec3 rate_rad_s{};  ///< body axes, against inertial space
};

/// State of the navigation. A powered descent has the phases of Apollo's (F. Bennett, NASA TN D-6846, 1972):
/// braking to the first target, an approach to each further one, the terminal descent to the ground.
enum class GuidancePhase : std::uint8_t {
    moving,
    holding,
    closing,
    docked,
    retreating,
    done,
    landed,
    braking,
    approach,
    terminal_descent,
};
inline constexpr std::array<std::string_view, 10> kGuidancePhases{
    "moving", "holding", "closing", "docked",   "retreating",
    "done",   "landed",  "braking", "approach", "terminal_descent"};

/// Why the navigation aborts.
enum class AbortReason : std::uint8_t { none, lost, uncertain, off_reference, bounced };
inline constexpr std::array<std::string_view, 5> kAbortReasons{"none", "lost", "uncertain", "off_reference",
                                                               "bounced"};

/// The impulses of the thrusters from t_ns on, within one control period.
struct ActuatorCommand {
    std::uint8_t counter = 0;
    std::int64_t t_ns = 0;
    Vec3 impulse_n_s{};            ///< force times time, chaser's body axes
    Vec3 angular_impulse_n_m_s{};  ///< torque about the centre of mass times time
    GuidancePhase phase = GuidancePhase::moving;
    std::uint8_t leg = 0;  ///< index in the scenario
    AbortReason abort = AbortReason::none;
};

/// The estimated pose of the target relative to the chaser at t_ns: body axes of both, as in the scene.
struct NavigationEstimate {
    std::uint32_t cycle = 0;
    std::int64_t t_ns = 0;
    Rigid3 T_chaser_target{};
    Vec3 sigma_rotation_rad{}, sigma_position_m{};  ///< standard deviations, chaser's body axes
    std::uint8_t frames = 0, sweeps = 0;            ///< measurements used since the last estimate
};

}  // namespace narpa
