/// rehearsal/navigation/guidance/flight_control.h - feedback control of the chaser's port to the reference, and
/// thrust allocation. A chaser with an engine tilts it to the direction of the force; thrusters add the rest across
/// it.
#pragma once

#include <array>

#include "rehearsal/navigation/guidance/guidance.h"

namespace narpa::rehearsal {

/// Gains of a sampled double integrator with an impulse at the start of each period: a = position (r - x) +
/// velocity (r' - x'), applied as dv = a * period_s, has the discretised poles of a continuous loop of this
/// bandwidth and damping.
struct SampledGains {
    double position_s2 = 0, velocity_s = 0;  ///< s^-2, s^-1

    static SampledGains of(double bandwidth_rad_s, double damping, double period_s);
};

/// Pulse modulation of one thruster axis: no pulse below the smallest, none above the largest. Impulses that are
/// too small accumulate, so that the mean is right.
class PulseAxis {
public:
    PulseAxis(double least, double most) : least_(least), most_(most) {}
    [[nodiscard]] double modulate(double wanted) noexcept;
    void reset() noexcept { saved_ = 0; }

private:
    double least_, most_;
    double saved_ = 0;
};

struct Impulses {
    Vec3 linear_n_s{}, angular_n_m_s{};  ///< chaser's body axes, about the centre of mass
};

class FlightControl {
public:
    explicit FlightControl(const Scenario& scenario);

    /// Impulses for one period from t_s on. Controls the port's position through the centre of mass, and
    /// compensates the port's motion due to the chaser's rotation. Feeds forward gravity and the acceleration of
    /// the rotating port axes.
    [[nodiscard]] Impulses step(double t_s, const RelativeMotion& motion, const Reference& reference);
    /// Mass of the chaser, which decreases as an engine burns propellant.
    void set_mass(double mass_kg) noexcept { chaser_.mass_kg = mass_kg; }
    /// Clears the accumulated impulses.
    void reset() noexcept;

private:
    [[nodiscard]] Impulses step_with_engine(double t_s, const RelativeMotion& motion, const Reference& reference);
    [[nodiscard]] Quat q_world_wanted(const RelativeMotion& m, const Reference& reference) const;
    [[nodiscard]] Vec3 angular_acceleration(const RelativeMotion& m, const Reference& reference,
                                            const Quat& q_world_wanted) const;
    [[nodiscard]] Vec3 acceleration(double t_s, const RelativeMotion& m, const Reference& reference,
                                    const Vec3& angular_acceleration_rad_s2) const;

    Orbit orbit_;
    std::optional<Engine> engine_;
    Vehicle target_, chaser_;
    double period_s_;
    SampledGains position_, attitude_;
    double acceleration_most_m_s2_, turn_acceleration_most_rad_s2_;
    double turn_most_rad_s_;  ///< largest rate of attitude corrections
    std::array<PulseAxis, 3> force_, torque_;
};

}  // namespace narpa::rehearsal
