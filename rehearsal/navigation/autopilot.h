/// rehearsal/navigation/autopilot.h - the chaser's flight computer without input and output: measurements in,
/// estimates and commands out.
///
/// One thread may add measurements while another runs the cycles. Called in sequence, the output depends on the
/// inputs and their order alone.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "rehearsal/navigation/estimation/measurements.h"
#include "rehearsal/navigation/estimation/velocimeter.h"
#include "rehearsal/navigation/guidance/flight_control.h"
#include "rehearsal/navigation/guidance/guidance.h"

namespace narpa::rehearsal {

/// The outcome of a frame or a sweep.
struct MeasurementRecord {
    enum class Outcome : std::uint8_t { taken, gated, too_late, bad, no_pose };  ///< UpdateOutcome, and no pose
    std::string sensor;
    std::int64_t t_ns = 0;
    Outcome outcome = Outcome::no_pose;
    double nis = 0;   ///< normalised innovation squared; 0 where it was not formed
    std::string why;  ///< empty where it was taken
    int points = 0;
    double ms = 0;
    AnswerKind answer = AnswerKind::good;  ///< classification of the measurement's own pose
};
inline constexpr std::array<std::string_view, 5> kMeasurementOutcomes{"taken", "gated", "too_late", "bad",
                                                                      "no_pose"};

/// One control period.
struct CycleRecord {
    NavigationEstimate estimate;
    ActuatorCommand command;
    double t_s = 0;  ///< after the scenario's time 0
    PortState port;
    Reference reference;
    double position_sigma_m = 0;
    std::vector<MeasurementRecord> measurements;  ///< since the cycle before
};

class Autopilot {
public:
    /// Reads the scene. Errors: of the scene or of the scenario's sensors.
    static Result<std::unique_ptr<Autopilot>> create(const Scenario& scenario, std::uint64_t seed);

    [[nodiscard]] const Scenario& scenario() const noexcept { return scenario_; }
    [[nodiscard]] const SceneModel& model() const noexcept { return *model_; }

    /// `t_start_ns`: the scenario's time 0; `attitude`: the chaser's at that time. Errors: the filter's.
    Status start(std::int64_t t_start_ns, const AttitudeReport& attitude);

    // The following need start().

    void take(const AttitudeReport& report);
    /// Phase of the dynamics at t_ns; before the measurements of that time.
    void take(DynamicsPhase phase, std::int64_t t_ns);
    /// `camera`, `lidar`: indices in the scenario's lists. take_frame: the frame's bytes and mid-exposure.
    /// take_sweep: the returns of a turn, with times relative to its end, t_ns.
    void take_frame(std::size_t camera, std::int64_t t_ns, std::span<const std::uint8_t> bytes);
    void take_sweep(std::size_t lidar, std::int64_t t_ns, LidarSweep sweep);
    /// A shot that a LiDAR reports on CAN. Ignored if the scenario does not navigate by it, or if it met nothing
    /// near the target.
    void take_beam(const LidarBeamReport& report);
    /// A measurement of any other sensor; counts as a frame.
    void take(const std::string& sensor, std::int64_t t_ns, const MeasurementResult& measurement) {
        take(sensor, t_ns, measurement, frames_);
    }
    /// Estimate at t_ns and command for a control period from `lead_ns` after it on; t_ns grows by control periods.
    CycleRecord cycle(std::int64_t t_ns, std::int64_t lead_ns = 0);

    [[nodiscard]] std::uint64_t restarts() const noexcept { return estimator_ ? estimator_->restarts() : 0; }

private:
    Autopilot() = default;
    /// The filter's state, as prediction for a measurement.
    [[nodiscard]] Prediction predict(std::int64_t t_ns);
    void take(const std::string& sensor, std::int64_t t_ns, const MeasurementResult& measurement,
              std::uint8_t& count);

    Scenario scenario_;
    std::unique_ptr<SceneModel> model_;
    std::deque<CameraPoseEstimator> cameras_;  ///< a deque: elements stay in place
    std::vector<LidarPoseEstimator> lidars_;
    std::vector<Velocimeter> velocimeters_;

    std::mutex mutex_;  ///< guards the members below
    std::optional<StateEstimator> estimator_;
    std::optional<Guidance> guidance_;
    std::optional<FlightControl> control_;
    std::vector<MeasurementRecord> measurements_;
    DynamicsPhase dynamics_ = DynamicsPhase::flying;
    std::uint8_t frames_ = 0, sweeps_ = 0;
    std::uint32_t cycle_ = 0;
};

}  // namespace narpa::rehearsal
