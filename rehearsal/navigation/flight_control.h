/// rehearsal/navigation/flight_control.h - what the thrusters do so that the chaser's port goes where it should.
#pragma once

#include <array>

#include "rehearsal/navigation/guidance.h"

namespace narpa::rehearsal {

/// Of a double integrator that is pushed at the beginning of each period: a = position (r - x) + velocity (r' -
/// x'), given as a dv of a * period_s, has the sampled poles of the continuous ones of this bandwidth and damping.
struct SampledGains {
    double position_s2 = 0, velocity_s = 0;  ///< s^-2, s^-1

    static SampledGains of(double bandwidth_rad_s, double damping, double period_s);
};

/// One thruster axis: nothing below the least pulse, nothing above the most; what is too little is saved up, so
/// that small forces are given in the mean.
class PulseAxis {
public:
    PulseAxis(double least, double most) : least_(least), most_(most) {}
    [[nodiscard]] double give(double wanted) noexcept;
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

    /// For one period from t_s on. The centre of mass is steered so that the port follows: what the port does as
    /// the chaser turns about its centre of mass is allowed for. Known accelerations are fed forward: gravity's
    /// and the turning port's.
    [[nodiscard]] Impulses step(double t_s, const RelativeMotion& motion, const Reference& reference);
    /// Nothing is fired, nothing saved up.
    void rest() noexcept;

private:
    [[nodiscard]] Vec3 angular_acceleration(const RelativeMotion& m, const Reference& reference) const;
    [[nodiscard]] Vec3 acceleration(double t_s, const RelativeMotion& m, const Reference& reference,
                                    const Vec3& angular_acceleration_rad_s2) const;

    Orbit orbit_;
    Vehicle target_, chaser_;
    double period_s_;
    SampledGains position_, attitude_;
    double acceleration_most_m_s2_, turn_acceleration_most_rad_s2_;
    double turn_most_rad_s_;  ///< rate at which an error of attitude is taken back
    std::array<PulseAxis, 3> force_, torque_;
};

}  // namespace narpa::rehearsal
