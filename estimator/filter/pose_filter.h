/// estimator/filter/pose_filter.h - fusion over time: poses from any sensor, each with its covariance and its own
/// time, become position, velocity, attitude and rate.
///
/// A multiplicative extended Kalman filter: the attitude is a quaternion, its error a vector of three (F. Markley,
/// "Attitude error representations for Kalman filtering", J. Guidance 26(2), 2003; F. Markley, J. Crassidis,
/// Fundamentals of Spacecraft Attitude Determination and Control, 2014, chapter 6). Covariances are kept in
/// Joseph's form. A measurement that comes late is set in at its own time, and what came after it is done again.
#pragma once

#include <cstdint>
#include <vector>

#include "estimator/filter/motion_model.h"

namespace narpa {

struct FilterSettings {
    MotionModel motion{};
    /// Measurements whose normalised innovation squared (NIS) exceeds this are not taken: 0.9999 of chi-square with
    /// six degrees of freedom.
    double gate = 27.86;
    /// Measurements and changes of the known acceleration that are kept, against late measurements; >= 2.
    std::size_t history = 32;
};

/// A sensor's word on where the target is.
struct PoseMeasurement {
    std::int64_t t_ns = 0;  ///< when it was so: mid-exposure, the time of a sweep's pose
    Rigid3 T_sensor_target{};
    Matrix6 covariance = Matrix6::Zero();  ///< of its error (pose_estimate.h): sensor axes, positive definite
    Rigid3 T_chaser_sensor{};              ///< how the sensor is mounted
    Quat q_frame_chaser{};                 ///< the chaser's attitude then, taken as exact
};

enum class UpdateOutcome : std::uint8_t {
    taken,
    gated,     ///< it contradicts what is known
    too_late,  ///< it is older than the history
    bad,       ///< not finite, no unit quaternion, or a covariance that is not symmetric and positive definite
};

struct UpdateResult {
    UpdateOutcome outcome = UpdateOutcome::taken;
    double nis = 0;        ///< normalised innovation squared, six degrees of freedom; 0 where it was not formed
    const char* why = "";  ///< what is wrong and what was expected, where the outcome is not `taken`
};

struct UpdateCounts {
    std::uint64_t taken = 0, late = 0, gated = 0, too_late = 0, bad = 0;  ///< late: of those taken, into the past
    std::uint64_t gated_in_a_row = 0;  ///< since the last that was taken: many mean that the filter is lost
};

class PoseFilter {
public:
    /// What is known at t_ns. Errors: settings, a state that is not finite, a covariance that is not positive
    /// definite.
    static Result<PoseFilter> create(const FilterSettings& settings, std::int64_t t_ns, const RelativeState& state,
                                     const Matrix12& covariance);
    /// From a first measurement; velocity and rate are unknown but for these standard deviations about zero (of the
    /// rate: about the frame's).
    static Result<PoseFilter> create(const FilterSettings& settings, const PoseMeasurement& first,
                                     double velocity_sigma_m_s, double rate_sigma_rad_s);

    // What follows allocates and throws nothing.

    /// Moves on to t_ns; an earlier time changes nothing.
    void predict(std::int64_t t_ns);
    /// From the filter's time on the target accelerates so relative to the chaser, frame axes, until told
    /// otherwise: minus what the chaser's thrusters do. `psd`: of white noise on each axis, beside the motion
    /// model's own, for what thrust leaves unsure (m^2 s^-3). Must be finite, psd >= 0; else it is not taken and
    /// false comes back.
    bool accelerate(const Vec3& acceleration_m_s2, double psd = 0);
    /// Takes a measurement; moves on to its time where that is later.
    UpdateResult update(const PoseMeasurement& measurement);

    [[nodiscard]] std::int64_t t_ns() const noexcept { return t_ns_; }
    [[nodiscard]] const RelativeState& state() const noexcept { return now_.state; }
    /// Of the state's error (motion_model.h).
    [[nodiscard]] const Matrix12& covariance() const noexcept { return now_.covariance; }
    [[nodiscard]] const UpdateCounts& counts() const noexcept { return counts_; }

    struct Pose {
        Rigid3 T_chaser_target{};
        Matrix6 covariance = Matrix6::Zero();  ///< of its error (pose_estimate.h), chaser axes
    };
    /// As a chaser of this attitude sees the target.
    [[nodiscard]] Pose pose(const Quat& q_frame_chaser) const;

private:
    struct Knowledge {
        RelativeState state;
        Matrix12 covariance;
    };
    struct Thrust {
        Vec3 acceleration_m_s2{};
        double psd = 0;
        friend bool operator==(const Thrust&, const Thrust&) = default;
    };
    /// What happened at a time, and what was known after it.
    struct Event {
        std::int64_t t_ns = 0;
        Knowledge after;
        Thrust thrust;  ///< from then on
        bool measured = false;
        PoseMeasurement measurement;
    };
    explicit PoseFilter(const FilterSettings& settings) : settings_(settings) {}

    [[nodiscard]] Knowledge moved_on(Knowledge from, const Thrust& thrust, std::int64_t by_ns) const;
    [[nodiscard]] Knowledge after(const Event& event, std::int64_t t_ns) const {
        return moved_on(event.after, event.thrust, t_ns - event.t_ns);
    }
    void remember(std::size_t place, const Event& event);

    FilterSettings settings_;
    std::int64_t t_ns_ = 0;
    Knowledge now_;
    std::vector<Event> history_;  ///< by time; the last is what `now_` comes from
    UpdateCounts counts_;
};

}  // namespace narpa
