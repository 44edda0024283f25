/// rehearsal/dynamics/simulation.h - the motion of two bodies near each other from a scenario's time 0 to its end:
/// orbit, attitude, thrusters, contact. Has no clock and no bus: equal scenario, seed and commands give equal
/// results.
///
/// Contact does not move the target: its centre of mass is the world's origin, and only relative motion matters.
/// Contact is between docking ports, or between a landing gear and the ground.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string_view>

#include "protocols/closed_loop.h"
#include "rehearsal/dynamics/ground_contact.h"
#include "rehearsal/dynamics/rigid_body.h"
#include "rehearsal/dynamics/thruster_model.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Motions of the bodies' axes, as in the scene and on CAN.
struct Truth {
    Motion attractor, target, chaser;
};

/// Random draws of unit variance, in this order; multiplied by the scenario's standard deviations they are the
/// dispersion of the start.
struct StartDraws {
    Vec3 position, velocity, attitude, rate;
};

struct ContactEvent {
    std::int64_t t_ns = 0;
    PortState port;         ///< just before
    bool captured = false;  ///< or landed
};

/// Why a run has ended; left: the chaser has retreated far beyond its start.
enum class Ending : std::uint8_t { not_yet, captured, bounced, duration, navigation_done, left, landed, crashed };
inline constexpr std::array<std::string_view, 8> kEndings{"not_yet",         "captured", "bounced", "duration",
                                                          "navigation_done", "left",     "landed",  "crashed"};

class Simulation {
public:
    /// `terrain`: the ground, where the scenario has a landing gear.
    Simulation(const Scenario& scenario, std::uint64_t seed, std::shared_ptr<const Terrain> terrain = {});

    /// The scenario's time.
    [[nodiscard]] std::int64_t t_ns() const noexcept { return state_.t_ns; }
    /// Sets the thruster command from now on; returns false if a fault loses it.
    bool apply(const ActuatorCommand& command);
    /// Advances to t_ns, or to an earlier change of phase(); at contact of ports the state is that just before. The
    /// next call continues from there.
    void advance_to(std::int64_t t_ns);
    /// Star tracker and gyroscope, with noise.
    [[nodiscard]] AttitudeReport measure_attitude();

    [[nodiscard]] Truth truth() const;
    [[nodiscard]] PortState port() const;
    [[nodiscard]] DynamicsPhase phase() const noexcept { return phase_; }
    /// The first contact.
    [[nodiscard]] const std::optional<ContactEvent>& contact() const noexcept { return contact_; }
    [[nodiscard]] Ending ending() const;
    /// Mass of the chaser, which decreases as an engine burns propellant.
    [[nodiscard]] double mass_kg() const noexcept { return state_.mass_kg; }
    /// Height of the lowest foot above the ground, where there is a landing gear.
    [[nodiscard]] std::optional<double> clearance_m() const;

    /// Impulse and angular impulse since the start, body axes.
    [[nodiscard]] const Loads& fired() const noexcept { return fired_; }
    [[nodiscard]] const StartDraws& start_draws() const noexcept { return draws_; }
    [[nodiscard]] const ThrusterModel& thrusters() const noexcept { return thrusters_; }
    /// The last command that was not lost.
    [[nodiscard]] const ActuatorCommand& command() const noexcept { return command_; }

private:
    struct State {
        std::int64_t t_ns = 0;
        Attitude target, chaser;
        Translation translation;
        double mass_kg = 1;
    };

    void place_bodies(std::uint64_t seed);
    void change_target_rate(std::int64_t after_ns, std::int64_t until_ns);
    [[nodiscard]] State after(const State& from, const Loads& loads, std::int64_t dt_ns) const;
    [[nodiscard]] Attitude target_after(const State& from, double dt_s) const;
    [[nodiscard]] Motion target_motion(const State& state) const;
    [[nodiscard]] Motion chaser_motion_of(const State& state) const;
    [[nodiscard]] PortState port(const State& state) const;
    void fire_for(const Loads& loads, std::int64_t dt_ns);
    [[nodiscard]] bool passes_plane(const State& before, const State& then) const;
    [[nodiscard]] State at_plane(const Loads& loads, std::int64_t dt_ns, std::int64_t before_ns) const;
    [[nodiscard]] bool ports_meet(const State& state) const;
    void touch(const State& met, const Loads& loads);
    void rebound_or_hold();
    void rebound(State& state) const;
    void advance_lander(std::int64_t t_ns);
    [[nodiscard]] Loads ground_loads();
    [[nodiscard]] bool judge_landing(double deepest_m);
    void hold();

    Scenario scenario_;
    RigidBody target_body_, chaser_body_;
    ThrusterModel thrusters_;
    std::mt19937_64 sensor_;
    StartDraws draws_{};
    State state_;
    DynamicsPhase phase_ = DynamicsPhase::flying;
    bool at_contact_ = false;       // at a contact, before advance_to continues
    std::optional<Rigid3> T_held_;  // captured: chaser's body at its centre of mass, in the target's
    std::optional<ContactEvent> contact_;
    std::optional<GroundContact> ground_;
    double deepest_m_ = 0;                  // largest penetration of a foot, for the next step
    std::optional<std::int64_t> still_ns_;  // at rest on its feet since then
    std::int64_t settled_ns_ = 0;           // time of landing or crash
    Loads fired_{};
    ActuatorCommand command_{};
};

}  // namespace narpa::rehearsal
