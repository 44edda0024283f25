/// rehearsal/navigation/state_estimator.h - the filter, fed with body poses as sensors see them and with what the
/// thrusters were told: between the sensors' body axes and the filter's centres of mass.
#pragma once

#include <deque>

#include "estimator/cloud/range_points.h"
#include "estimator/filter/pose_filter.h"
#include "rehearsal/navigation/attitude_track.h"
#include "rehearsal/navigation/flight_control.h"

namespace narpa::rehearsal {

/// A sensor's word: the target's body axes from the sensor's, errors as in estimator/pose/pose_estimate.h.
struct TargetMeasurement {
    std::int64_t t_ns = 0;
    Rigid3 T_sensor_target{};
    Matrix6 covariance = Matrix6::Zero();
    Rigid3 T_chaser_sensor{};  ///< body axes
};

/// The target beside the chaser, body axes of both as in the scene, covariance in chaser axes.
struct TargetEstimate {
    Rigid3 T_chaser_target{};
    Matrix6 covariance = Matrix6::Zero();
};

/// About the centres of mass: the target's point is shifted, and its rotation's error shifts it (t' = t + R c, so
/// dt' = dt + dr x R c). The star tracker's error, `attitude_sigma_rad` on each axis, is added: it turns the target
/// about the chaser.
[[nodiscard]] PoseMeasurement at_centres_of_mass(const TargetMeasurement& measurement, const Vec3& chaser_centre_m,
                                                 const Vec3& target_centre_m, const Quat& q_frame_chaser,
                                                 double attitude_sigma_rad);

class StateEstimator {
public:
    /// Knows the scenario's nominal start at t_start_ns, with its standard deviations.
    /// Errors: the filter's.
    static Result<StateEstimator> create(const Scenario& scenario, std::int64_t t_start_ns,
                                         const AttitudeReport& attitude);

    /// The chaser's attitude from now on.
    void take(const AttitudeReport& report) { attitude_.take(report); }
    /// What was told to the thrusters at t_ns: each pulse acts from then on for as long as it takes at full force.
    void thrust(std::int64_t t_ns, const Vec3& impulse_n_s);
    /// Late ones are set in at their own time. So many in a row that contradict the filter are right, and it is
    /// wrong: it begins anew from the last of them.
    UpdateResult take(const TargetMeasurement& measurement);
    /// The ports met shortly before t_ns: velocities are not what they were. `held`: the docking system holds, the
    /// ports' origins lie in one plane and rest against each other; otherwise they part, at an unknown speed.
    void met(std::int64_t t_ns, bool held);
    /// Moves on.
    void advance(std::int64_t t_ns);

    /// At the time that it was moved on to, or of the newest measurement where that is later.
    [[nodiscard]] std::int64_t t_ns() const noexcept { return filter_.t_ns(); }
    [[nodiscard]] RelativeMotion motion() const;
    [[nodiscard]] AttitudeTrack::At attitude(std::int64_t t_ns) const noexcept { return attitude_.at(t_ns); }
    [[nodiscard]] TargetEstimate estimate() const;
    /// What it knows, at another time near by.
    [[nodiscard]] Rigid3 guess(std::int64_t t_ns) const;
    /// How the target moves in the chaser's body axes: velocity of its body origin, and rate.
    [[nodiscard]] SweepMotion motion_in_chaser() const;
    [[nodiscard]] double t_s(std::int64_t t_ns) const noexcept {
        return 1e-9 * static_cast<double>(t_ns - t_start_ns_);
    }

    [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }
    /// When a measurement was taken last; the start before there was one.
    [[nodiscard]] std::int64_t taken_ns() const noexcept { return taken_ns_; }

private:
    struct Pulse {
        std::int64_t from_ns = 0;
        Vec3 acceleration_m_s2{};  ///< of the target beside the chaser, frame axes
        double psd = 0;
    };
    StateEstimator(const Scenario& scenario, std::int64_t t_start_ns, PoseFilter filter)
        : scenario_(scenario), t_start_ns_(t_start_ns), filter_(std::move(filter)), taken_ns_(t_start_ns) {}
    [[nodiscard]] Quat q_frame_chaser(std::int64_t t_ns) const;

    Scenario scenario_;
    std::int64_t t_start_ns_;
    PoseFilter filter_;
    AttitudeTrack attitude_;
    std::deque<Pulse> pulses_;  ///< that have not begun at the filter's time
    std::int64_t taken_ns_;
    std::uint64_t restarts_ = 0;
};

}  // namespace narpa::rehearsal
