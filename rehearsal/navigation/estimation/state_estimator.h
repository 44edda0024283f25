/// rehearsal/navigation/estimation/state_estimator.h - the navigation filter with pose measurements and thruster
/// commands as inputs: converts between the bodies' axes and the filter's centres of mass.
#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <optional>

#include "estimator/cloud/range_points.h"
#include "estimator/filter/pose_filter.h"
#include "estimator/pose/apparent_motion.h"
#include "protocols/closed_loop.h"
#include "rehearsal/navigation/estimation/relative_motion.h"

namespace narpa::rehearsal {

class AttitudeTrack {
public:
    /// Returns false if the report is not newer than the last one; it is then ignored.
    bool take(const AttitudeReport& report) noexcept;
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
    [[nodiscard]] const AttitudeReport& newest() const noexcept { return reports_[count_ - 1]; }

    /// Weight of the newest report's error in the result of `at`.
    [[nodiscard]] double share_of_newest(std::int64_t t_ns) const noexcept;

    /// True if a report of this time, to a millisecond, is kept.
    [[nodiscard]] bool has(std::int64_t t_ns) const noexcept;

    struct At {
        Quat q_world_chaser{};
        Vec3 rate_rad_s{};  ///< body axes, against inertial space
    };
    /// Between two reports along the shortest arc; outside them extrapolated at the nearest one's rate. Must not be
    /// empty.
    [[nodiscard]] At at(std::int64_t t_ns) const noexcept;

private:
    std::array<AttitudeReport, 8> reports_{};  ///< oldest first
    std::size_t count_ = 0;
};

/// Pose of the target's body axes in a sensor's axes, with its covariance (estimator/pose/pose_estimate.h).
struct TargetMeasurement {
    std::int64_t t_ns = 0;
    Rigid3 T_sensor_target{};
    Matrix6 covariance = Matrix6::Zero();
    Rigid3 T_chaser_sensor{};  ///< body axes
    /// Replaces `covariance` if some motions are not observed (root_information.h).
    std::optional<Matrix6> root_information{};
    Matrix6 covariance_of_model = Matrix6::Zero();  ///< part that is common to all measurements
};

/// Velocity of the target's surface along a beam of the chaser (estimator/filter/pose_filter.h).
struct TargetVelocity {
    std::int64_t t_ns = 0;
    Vec3 origin_m{}, direction{};  ///< of the beam, body axes
    double range_m = 0, velocity_m_s = 0, sigma_m_s = 0;
};

/// A range along a beam of the chaser to a plane that approximates the target's surface there
/// (estimator/filter/pose_filter.h).
struct TargetRange {
    std::int64_t t_ns = 0;
    Vec3 origin_m{}, direction{};  ///< of the beam, body axes
    Vec3 point_m{}, normal{};      ///< of the plane, target's body axes
    double range_m = 0, sigma_m = 0;
};

/// Pose of the target in the chaser's axes, body axes of both as in the scene; covariance in chaser axes.
struct TargetEstimate {
    Rigid3 T_chaser_target{};
    Matrix6 covariance = Matrix6::Zero();
};

/// Converts the measurement to the centres of mass. Moving the target's reference point couples in the rotation
/// error (t' = t + R c, so dt' = dt + dr x R c). Adds the star tracker's error, `attitude_sigma_rad` on each axis,
/// which rotates the target about the chaser.
[[nodiscard]] PoseMeasurement at_centres_of_mass(const TargetMeasurement& measurement, const Vec3& chaser_centre_m,
                                                 const Vec3& target_centre_m, const Quat& q_frame_chaser,
                                                 double attitude_sigma_rad);

class StateEstimator {
public:
    /// Starts from the scenario's nominal start at t_start_ns, with its standard deviations.
    /// Errors: the filter's.
    static Result<StateEstimator> create(const Scenario& scenario, std::int64_t t_start_ns,
                                         const AttitudeReport& attitude);

    /// Sets the chaser's attitude from now on.
    void take(const AttitudeReport& report) {
        if (attitude_.take(report)) by_star_tracker_.setZero();
    }
    /// Impulses commanded at t_ns: each pulse starts then and lasts as long as needed at full force.
    void thrust(std::int64_t t_ns, const Vec3& impulse_n_s);
    /// Late measurements are inserted at their own time. After several gated ones in a row the filter
    /// restarts from the last of them.
    UpdateResult take(const TargetMeasurement& measurement);
    /// Affects neither restarts nor the time of the last pose measurement. Returns none, without effect, unless the
    /// chaser reported its rate at that time: between reports thrusters change the rate, and through the beam's
    /// lever arm the velocity.
    std::optional<UpdateResult> take(const TargetVelocity& velocity);
    UpdateResult take(const TargetRange& range);
    /// The ports touched shortly before t_ns. `held`: captured, the ports' planes coincide and are at rest;
    /// otherwise they separate at an unknown speed.
    void on_contact(std::int64_t t_ns, bool held);
    /// A foot touched the ground shortly before t_ns: from then on the lander rests there.
    void on_touchdown(std::int64_t t_ns);
    /// Predicts to t_ns.
    void advance(std::int64_t t_ns);

    /// Time of the state: that of the last prediction or of the newest measurement, whichever is later.
    [[nodiscard]] std::int64_t t_ns() const noexcept { return filter().t_ns(); }
    [[nodiscard]] RelativeMotion motion() const;
    [[nodiscard]] AttitudeTrack::At attitude(std::int64_t t_ns) const noexcept { return attitude_.at(t_ns); }
    [[nodiscard]] TargetEstimate estimate() const;
    /// T_chaser_target at a nearby time, by the estimated rates.
    [[nodiscard]] Rigid3 predicted(std::int64_t t_ns) const;
    /// Motion of the target in the chaser's body axes: velocity of its body origin, and rate.
    [[nodiscard]] ApparentMotion motion_in_chaser() const;
    [[nodiscard]] double t_s(std::int64_t t_ns) const noexcept {
        return 1e-9 * static_cast<double>(t_ns - t_start_ns_);
    }

    [[nodiscard]] std::uint64_t restarts() const noexcept { return tracker_.restarts(); }
    /// Mass of the chaser, less the propellant burnt by commands.
    [[nodiscard]] double mass_kg() const noexcept { return mass_kg_; }
    /// Time of the last accepted measurement; initially the start.
    [[nodiscard]] std::int64_t taken_ns() const noexcept { return taken_ns_; }

private:
    struct Pulse {
        std::int64_t from_ns = 0;
        Vec3 acceleration_m_s2{};  ///< of the target relative to the chaser, frame axes
        double psd = 0;
    };
    StateEstimator(const Scenario& scenario, std::int64_t t_start_ns, PoseTracker tracker)
        : scenario_(scenario),
          t_start_ns_(t_start_ns),
          tracker_(std::move(tracker)),
          taken_ns_(t_start_ns),
          mass_kg_(scenario.chaser.mass_kg) {}
    [[nodiscard]] const PoseFilter& filter() const noexcept { return tracker_.filter(); }
    [[nodiscard]] Quat q_frame_chaser(std::int64_t t_ns) const;
    void restart_at(const Vec3& port_m, const Vec3& port_velocity_m_s, const Vector12& more);
    [[nodiscard]] Matrix6 covariance_of_model(const Rigid3& T_chaser_target) const;
    void correlate(const Matrix12& before, double share);
    [[nodiscard]] Eigen::Matrix<double, 12, 3> by_star_tracker(double sigma_rad) const;

    Scenario scenario_;
    std::int64_t t_start_ns_;
    PoseTracker tracker_;  ///< started
    AttitudeTrack attitude_;
    /// Jacobian of the state's error by the error of the newest attitude report, with which measurements were
    /// rotated to the frame.
    Eigen::Matrix<double, 12, 3> by_star_tracker_ = Eigen::Matrix<double, 12, 3>::Zero();
    std::deque<Pulse> pulses_;  ///< pulses that start after the filter's time
    std::int64_t taken_ns_;
    double mass_kg_;
    bool resting_ = false;
    std::optional<Matrix6> by_model_;  ///< covariance_of_model of the newest measurement, chaser axes
};

}  // namespace narpa::rehearsal
