/// estimator/filter/pose_filter.h - fuses pose measurements of any sensor over time into position, velocity,
/// attitude and rate.
///
/// A multiplicative extended Kalman filter: the attitude is a quaternion, its error a vector of three (F. Markley,
/// "Attitude error representations for Kalman filtering", J. Guidance 26(2), 2003; F. Markley, J. Crassidis,
/// Fundamentals of Spacecraft Attitude Determination and Control, 2014, chapter 6). Covariances are kept in
/// Joseph's form. A late measurement is inserted at its own time and later ones are repeated.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "estimator/filter/motion_model.h"
#include "estimator/pose/apparent_motion.h"

namespace narpa {

struct FilterSettings {
    MotionModel motion{};
    /// Gate of the normalised innovation squared (NIS): the 0.9999 quantile of chi-square with six degrees of
    /// freedom.
    double gate = 27.86;
    /// The same for velocity or range along a beam, one degree of freedom.
    double beam_gate = 15.14;
    /// Measurements and changes of the known acceleration that are kept, to insert late measurements; >= 2.
    std::size_t history = 32;
};

/// A sensor's measurement of the target's pose.
struct PoseMeasurement {
    std::int64_t t_ns = 0;  ///< time of validity: mid-exposure, the time of a sweep's pose
    Rigid3 T_sensor_target{};
    Matrix6 covariance = Matrix6::Zero();  ///< of its error (pose_estimate.h): sensor axes, positive definite
    Rigid3 T_chaser_sensor{};              ///< how the sensor is mounted
    Quat q_frame_chaser{};                 ///< the chaser's attitude then, taken as exact
    /// Replaces `covariance` if some motions are not observed (root_information.h). Each of them reduces the NIS's
    /// degrees of freedom by one. It starts no filter unless it observes all six.
    std::optional<Matrix6> root_information{};
};

/// A Doppler instrument's measurement of the target's velocity along a beam.
struct BeamVelocity {
    std::int64_t t_ns = 0;
    /// Chaser axes, from its centre of mass: where the beam starts, its unit direction, and where it meets the
    /// target (origin + range * direction).
    Vec3 origin_m{}, direction{}, point_m{};
    /// Velocity of the target's material point there minus that of the beam's origin, along the beam; receding:
    /// positive.
    double velocity_m_s = 0;
    double sigma_m_s = 0;      ///< standard deviation, > 0
    Quat q_frame_chaser{};     ///< the chaser's attitude then, taken as exact
    Vec3 chaser_rate_rad_s{};  ///< against inertial space, chaser axes, taken as exact
};

/// An altimeter's measurement of the range along a beam. The target's surface is taken as a plane about the beam's
/// expected hit.
struct BeamRange {
    std::int64_t t_ns = 0;
    Vec3 origin_m{},
        direction{};           ///< chaser axes, from its centre of mass: where the beam starts, its unit direction
    Vec3 point_m{}, normal{};  ///< of the plane: target axes, from its centre of mass; unit
    double range_m = 0;
    double sigma_m = 0;     ///< standard deviation, > 0, of the instrument and of the surface about the plane
    Quat q_frame_chaser{};  ///< the chaser's attitude then, taken as exact
};

enum class UpdateOutcome : std::uint8_t {
    taken,
    gated,     ///< its NIS exceeds the gate
    too_late,  ///< older than the history
    bad,       ///< not finite, no unit quaternion, or a covariance that is not symmetric and positive definite
};

struct UpdateResult {
    UpdateOutcome outcome = UpdateOutcome::taken;
    double nis = 0;  ///< normalised innovation squared, six degrees of freedom or one; 0 where it was not formed
    const char* why = "";  ///< what is wrong and what was expected, where the outcome is not `taken`
};

struct UpdateCounts {
    std::uint64_t taken = 0, late = 0, gated = 0, too_late = 0, bad = 0;  ///< late: of those taken, into the past
    std::uint64_t gated_in_a_row = 0;  ///< poses gated since the last one taken: many mean divergence
};

class PoseFilter {
public:
    /// From a state at t_ns. Errors: settings, a state that is not finite, a covariance that is not positive
    /// definite.
    static Result<PoseFilter> create(const FilterSettings& settings, std::int64_t t_ns, const RelativeState& state,
                                     const Matrix12& covariance);
    /// From a first measurement; velocity and rate have these standard deviations about zero (the rate about the
    /// frame's).
    static Result<PoseFilter> create(const FilterSettings& settings, const PoseMeasurement& first,
                                     double velocity_sigma_m_s, double rate_sigma_rad_s);

    // The functions below neither allocate nor throw.

    /// Propagates to t_ns; an earlier time changes nothing.
    void predict(std::int64_t t_ns);
    /// Sets the known acceleration of the target relative to the chaser, frame axes, from t_ns on: minus that of
    /// the chaser's thrusters. Propagates to t_ns; if that is before the filter's time, later events are repeated.
    /// `psd`: white noise on each axis in addition to the motion model's, for the uncertainty of the thrust (m^2
    /// s^-3). Returns false, without effect, unless finite and psd >= 0, and t_ns is within the history.
    bool accelerate(std::int64_t t_ns, const Vec3& acceleration_m_s2, double psd = 0);
    /// Updates with a measurement; propagates to its time where that is later.
    UpdateResult update(const PoseMeasurement& measurement);
    UpdateResult update(const BeamVelocity& measurement);
    UpdateResult update(const BeamRange& measurement);

    [[nodiscard]] std::int64_t t_ns() const noexcept { return t_ns_; }
    [[nodiscard]] const RelativeState& state() const noexcept { return now_.state; }
    /// Covariance of the state's error (motion_model.h).
    [[nodiscard]] const Matrix12& covariance() const noexcept { return now_.covariance; }
    [[nodiscard]] const UpdateCounts& counts() const noexcept { return counts_; }

    struct Pose {
        Rigid3 T_chaser_target{};
        Matrix6 covariance = Matrix6::Zero();  ///< of its error (pose_estimate.h), chaser axes
    };
    /// The target relative to a chaser of this attitude.
    [[nodiscard]] Pose pose(const Quat& q_frame_chaser) const;

private:
    struct Estimate {
        RelativeState state;
        Matrix12 covariance;
    };
    struct Thrust {
        Vec3 acceleration_m_s2{};
        double psd = 0;
        friend bool operator==(const Thrust&, const Thrust&) = default;
    };
    /// A measurement or a change of thrust, and the estimate after it.
    struct Event {
        std::int64_t t_ns = 0;
        Estimate after;
        Thrust thrust;                                                                       ///< from then on
        std::variant<std::monostate, PoseMeasurement, BeamVelocity, BeamRange> measurement;  ///< none: of thrust
    };
    explicit PoseFilter(const FilterSettings& settings) : settings_(settings) {}

    [[nodiscard]] Estimate propagated(Estimate from, const Thrust& thrust, std::int64_t by_ns) const;
    [[nodiscard]] Estimate after(const Event& event, std::int64_t t_ns) const {
        return propagated(event.after, event.thrust, t_ns - event.t_ns);
    }
    void insert(std::size_t place, const Event& event);
    void repeat_from(std::size_t place);
    [[nodiscard]] std::size_t first_after(std::int64_t t_ns) const;
    template <class Measurement>
    UpdateResult take(const Measurement& measurement, double gate);

    FilterSettings settings_;
    std::int64_t t_ns_ = 0;
    Estimate now_;
    std::vector<Event> history_;  ///< in order of time; `now_` is propagated from the last
    UpdateCounts counts_;
};

struct PoseTrackerSettings {
    FilterSettings filter{};
    /// Standard deviations of velocity and rate, about zero, where the filter starts from a measurement.
    double first_velocity_m_s = 1, first_rate_rad_s = 0.1;
    /// After this many consecutive gated measurements the filter restarts: the filter is taken to be wrong.
    std::uint64_t gated_in_a_row = 5;
};

class PoseTracker {
public:
    explicit PoseTracker(const PoseTrackerSettings& settings) : settings_(settings) {}

    /// Starts from a known state. Errors: those of PoseFilter::create; the filter then stays as it was.
    Status start(std::int64_t t_ns, const RelativeState& state, const Matrix12& covariance);
    /// Updates the filter; starts it, or starts it again, from this measurement. Only a start allocates. A second
    /// measurement that contradicts the first one starts it again at once, with a velocity and rate that are as
    /// uncertain as the motion between the two.
    UpdateResult update(const PoseMeasurement& measurement);
    /// Bad before the filter has started.
    UpdateResult update(const BeamVelocity& measurement);
    UpdateResult update(const BeamRange& measurement);
    /// The next measurement starts the filter.
    void stop() noexcept { filter_.reset(), first_.reset(); }

    [[nodiscard]] bool started() const noexcept { return filter_.has_value(); }
    /// Requires started().
    [[nodiscard]] PoseFilter& filter() noexcept { return *filter_; }
    [[nodiscard]] const PoseFilter& filter() const noexcept { return *filter_; }
    /// Number of restarts after measurements that contradicted the filter.
    [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }

private:
    [[nodiscard]] std::array<double, 2> first_sigmas(const PoseMeasurement& measurement) const;

    PoseTrackerSettings settings_;
    std::optional<PoseFilter> filter_;
    std::optional<PoseMeasurement> first_;  ///< that started the filter, until it takes another
    std::uint64_t restarts_ = 0;
};

}  // namespace narpa
