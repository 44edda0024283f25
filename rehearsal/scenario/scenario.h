/// rehearsal/scenario/scenario.h - the description of a rehearsal: two bodies, their start, guidance and control,
/// faults and gates. docs/rehearsal.md documents every key of the file.
///
/// Frames. World: the scene's, inertial axes, its origin at the target's centre of mass. LVLH (W. Clohessy, R.
/// Wiltshire, 1960): x up, away from the attractor, y along the circular orbit, z along its angular momentum,
/// rotating about z with the orbit's rate. Port: axes of a docking interface, x out of it. When docked, the
/// chaser's port is the target's rotated by 180 degrees about z. All times are seconds after the scenario's time 0.
///
/// A landing uses the same form. The target is the ground, its centre of mass a point fixed to it, its port the
/// landing site with x up; the chaser's port is in the plane of its feet, x down. LVLH is replaced by axes that
/// rotate with the planet, z along its axis of rotation.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "estimator/method/camera_method.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "rehearsal/contact/landing.h"
#include "rehearsal/contact/port_state.h"
#include "rehearsal/orbit/orbit.h"
#include "rehearsal/scenario/fault.h"
#include "renderer/keys/keys.h"

namespace narpa::rehearsal {

/// A rigid body of the scene that the dynamics command.
struct Vehicle {
    std::string body;          ///< its name in the scene
    std::uint32_t can_id = 0;  ///< as in the scene
    Vec3 centre_of_mass_m{};   ///< body axes
    Rigid3 T_body_port{};      ///< port axes to body axes
    double mass_kg = 1;
    Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Identity();  ///< about the centre of mass, body axes
};

/// Rotation of the target, from the scene's attitude at time 0.
struct TargetMotion {
    bool with_lvlh = true;  ///< rotates with LVLH, plus the rate below
    Vec3 rate_deg_s{};      ///< body axes, at time 0; relative to LVLH or to inertial space
};

/// Six pairs of thruster groups, one for each direction of force and torque along the chaser's body axes.
struct Thrusters {
    double force_n = 400, torque_n_m = 400;  ///< of a group that fires
    double min_on_s = 0.02;                  ///< shorter pulses are not fired
    double gain_sigma = 0.02;                ///< of each pulse, as a part of it
    double misalignment_sigma_deg = 0.5;     ///< of each group, drawn once a run
};

/// An engine whose force can be throttled, in place of one of the force groups. It burns for whole control periods.
struct Engine {
    std::size_t group = 4;  ///< index in kThrusterGroupNames, of a force
    double least_n = 0, most_n = 0;
    double gain_sigma = 0.005;      ///< of the force, drawn for each period
    double specific_impulse_s = 0;  ///< 0: the mass is constant
    double tilt_most_deg = 30;      ///< of its axis from the vertical, as commanded

    [[nodiscard]] int axis() const { return static_cast<int>(group / 2); }     ///< 0 to 2: x, y, z
    [[nodiscard]] double sign() const { return group % 2 == 0 ? 1.0 : -1.0; }  ///< of the force along it
};

/// Legs that touch the ground: each foot is a spring with a damper along the ground's normal, and friction.
struct LandingGear {
    std::vector<Vec3> feet_m;  ///< chaser's port axes: evenly on a circle about its x
    double stiffness_n_m = 40e3, damping_n_s_m = 6e3, friction = 0.6;  ///< of each
    double stroke_m = 0.3;                                             ///< a foot that penetrates deeper breaks
    double tipped_deg = 45;  ///< it has tipped over if further from the vertical
};

/// Star tracker and gyroscope of the chaser.
struct AttitudeSensor {
    double attitude_sigma_deg = 0.005;
    double rate_sigma_deg_s = 0.002;
};

/// The chaser's port relative to the target's at time 0, nominal values and standard deviations.
struct Start {
    Vec3 position_m{60, 0, 0}, position_sigma_m{};  ///< of its origin, target's port axes
    Vec3 velocity_m_s{}, velocity_sigma_m_s{};      ///< relative to the rotating port axes
    Vec3 attitude_deg{}, attitude_sigma_deg{};      ///< rotation vector off the docked attitude, chaser's port axes
    Vec3 rate_deg_s{}, rate_sigma_deg_s{};          ///< chaser's body axes, against the target
};

/// A leg of the reference trajectory of the chaser's port origin, in the target's port axes: along a straight line
/// from where the last leg ended (the first: the nominal start), or on an arc about the port's origin.
struct Leg {
    std::string name;
    Vec3 to_m{};                    ///< straight; arc: not used
    std::optional<double> arc_deg;  ///< on an arc instead, about `axis` (right-handed)
    Vec3 axis{0, 0, 1};
    double speed_m_s = 0.1;
    double hold_s = 0;                                          ///< at its end, at least
    double within_m = std::numeric_limits<double>::infinity();  ///< the hold lasts until the estimate is this close
    bool contact = false;         ///< continues at this speed until contact; the last leg only
    bool look_at_target = false;  ///< x towards the target's port origin; otherwise the docked attitude
    /// Powered descent instead: from the estimated state to `to_m` in this many seconds after the leg's start,
    /// arriving with `end_velocity_m_s` and without acceleration.
    std::optional<double> descent_s;
    Vec3 end_velocity_m_s{};
};

struct Navigation {
    std::string scene;  ///< path of the scene as the navigation knows it: with a map in place of the ground
    double map_sigma_m = 0,
           map_correlation_m = 0;              ///< errors of its heights, and their correlation length
    std::vector<std::string> cameras, lidars;  ///< names in the scene of the sensors to navigate by
    const CameraMethod* camera_method = &camera_methods().front();
    std::vector<std::string> velocimeters;  ///< LiDARs whose velocities come over CAN, beside the others
    double period_s = 1;                    ///< of measurements and of control
    /// Process noise in addition to that of the thrusters, which the filter adds itself, m^2 s^-3 and rad^2 s^-3.
    double acceleration_psd = 1e-10, angular_acceleration_psd = 1e-14;
    double abort_sigma_m = 2;  ///< aborts at this position uncertainty
    double abort_lost_s = 20;  ///< or after this long without a measurement
    double abort_off_m = 5;    ///< or this far off the reference
};

/// Errors of the navigation's model of the world, which the emulator does not render; vectors are along (1, 1, 1).
/// The estimators take `told` times these values as standard deviations.
struct ModelError {
    ModelUncertainty error;
    double told = 1;

    [[nodiscard]] ModelUncertainty uncertainty() const;
};

struct Control {
    double bandwidth_rad_s = 0.08, attitude_bandwidth_rad_s = 0.25;
    double damping = 0.9;
    double retreat_m_s = 0.3;  ///< away from the port, after an abort
    double turn_deg_s = 1;     ///< largest rate of attitude corrections
};

/// Requirements; an absent gate is not judged.
struct Gates {
    struct Corridor {
        double half_angle_deg = 10,
               radius_m = 0.5;  ///< a cone about the port's x axis with this radius at the port
        double from_m = 20;     ///< judged at ranges below this
    };
    struct NavigationError {
        double sigmas = 4;    ///< |error| of each of the six, in standard deviations as sent on CAN
        double share = 0.99;  ///< of the estimates that are within
        double position_m = std::numeric_limits<double>::infinity();  ///< largest error after the first measurement
        double attitude_deg = std::numeric_limits<double>::infinity();
    };
    std::optional<Corridor> corridor;
    std::optional<double> keep_out_m;  ///< sphere about the target's port that only the corridor may enter
    std::optional<std::pair<double, double>> distance_m;  ///< of the ports' origins, all the time
    std::optional<NavigationError> navigation;
    std::optional<CaptureEnvelope> contact;  ///< requires contact
    std::optional<LandingLimits> landing;    ///< requires a landing
    bool complete = true;                    ///< all legs flown, without an abort
};

struct Scenario {
    std::string file, name, title;
    std::string scene;                           ///< path of the scene file
    std::vector<std::string> overrides{};        ///< KEY=VALUE of `--set`, of the scenario and its scene
    std::vector<std::string> scene_overrides{};  ///< those of the scene
    std::vector<std::string> map_overrides{};    ///< those of Navigation::scene: all but those of bodies
    double duration_s = 600;
    double pose_rate_hz = 20;  ///< of pose commands; a multiple of 1 / navigation.period_s
    std::uint64_t seed = 1;    ///< of run 1; run k has seed + k - 1
    Orbit orbit;
    Vehicle target, chaser;
    TargetMotion target_motion;
    std::optional<std::pair<std::string, std::uint32_t>>
        attractor;  ///< scene body and can_id of the Earth, commanded too
    Start start;
    Thrusters thrusters;
    std::optional<Engine> engine;
    std::optional<LandingGear> gear;  ///< set: the chaser lands
    AttitudeSensor attitude_sensor;
    std::vector<Leg> legs;
    Navigation navigation;
    ModelError model_error;
    Control control;
    std::vector<Fault> faults;
    Gates gates;

    /// The target's attitude at time 0, body axes to world axes: the scene's.
    Quat q_world_target{};
    /// The attractor's attitude, which is constant: the scene's.
    Quat q_world_attractor{};

    /// Largest thrust, of the engine or of a force group.
    [[nodiscard]] double thrust_n() const { return engine ? engine->most_n : thrusters.force_n; }
    [[nodiscard]] std::int64_t period_ns() const;  ///< of navigation and control
    [[nodiscard]] std::int64_t pose_period_ns() const;
    /// The time that the legs and their holds take at their speeds; may exceed duration_s.
    [[nodiscard]] double legs_duration_s() const;
    /// legs_duration_s(), at most duration_s: for a progress display.
    [[nodiscard]] double nominal_duration_s() const { return std::min(legs_duration_s(), duration_s); }
};

/// The tables of a scenario file.
extern const TableKeys kScenarioFileKeys;

/// Files in place of those that a scenario names; empty: its own.
struct ScenarioFiles {
    std::string scene{}, map{};
};

/// `overrides`: values of single keys of the scenario and of its scene, KEY=VALUE (renderer/keys/toml_override.h).
/// Errors name file, line, column, what is wrong and what was expected.
Result<Scenario> read_scenario(const std::string& path, std::span<const std::string> overrides = {},
                               const ScenarioFiles& files = {});

}  // namespace narpa::rehearsal
