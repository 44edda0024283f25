/// rehearsal/navigation/autopilot.h - the chaser's computer without its wires: measurements in, estimates and
/// commands out.
///
/// Sightings may be taken by one thread while another runs the cycles. One after the other, what comes out depends
/// on what went in and in what order alone.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "rehearsal/navigation/guidance.h"
#include "rehearsal/navigation/measurements.h"

namespace narpa::rehearsal {

/// What became of a frame or a sweep.
struct MeasurementRecord {
    enum class Outcome : std::uint8_t { taken, gated, too_late, bad, no_pose };
    std::string sensor;
    std::int64_t t_ns = 0;
    Outcome outcome = Outcome::no_pose;
    double nis = 0;   ///< normalised innovation squared; 0 where it was not formed
    std::string why;  ///< where it was not taken
    int points = 0;
    double ms = 0;
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
    /// Reads the scene. Errors: of the scene, of the scenario's sensors.
    static Result<std::unique_ptr<Autopilot>> create(const Scenario& scenario, std::uint64_t seed);

    [[nodiscard]] const Scenario& scenario() const noexcept { return scenario_; }
    [[nodiscard]] const SceneModel& model() const noexcept { return *model_; }

    /// The scenario's time 0 is t_start_ns; that is the chaser's attitude then. Errors: the filter's.
    Status start(std::int64_t t_start_ns, const AttitudeReport& attitude);
    [[nodiscard]] bool started() const noexcept { return estimator_.has_value(); }

    // What follows needs a start.

    void take(const AttitudeReport& report);
    /// What the dynamics are doing at t_ns; before the measurements of that time.
    void take(DynamicsPhase phase, std::int64_t t_ns);
    /// `camera`, `lidar`: indices in the scenario's lists. A frame: its bytes and mid-exposure. Returns of a turn:
    /// their times count from t_ns, its end.
    void take_frame(std::size_t camera, std::int64_t t_ns, std::span<const std::uint8_t> bytes);
    void take_sweep(std::size_t lidar, std::int64_t t_ns, std::span<const RangePoint> points);
    /// What any other sensor saw at t_ns; counts as a frame.
    void take(const std::string& sensor, std::int64_t t_ns, const MeasurementResult& measurement) {
        take(sensor, t_ns, measurement, frames_);
    }
    /// Where it stands at t_ns, and what is to be done from then on; times grow by control periods.
    CycleRecord cycle(std::int64_t t_ns);

    [[nodiscard]] std::uint64_t restarts() const noexcept { return estimator_ ? estimator_->restarts() : 0; }

private:
    /// What a measurement starts from.
    struct Before {
        double t_s = 0;
        Quat q_world_chaser{};
        Rigid3 T_chaser_target{};
        SweepMotion motion{};
        double position_sigma_m = 0, rotation_sigma_rad = 0;
    };
    Autopilot() = default;
    [[nodiscard]] Before before(std::int64_t t_ns);
    void take(const std::string& sensor, std::int64_t t_ns, const MeasurementResult& measurement,
              std::uint8_t& count);

    Scenario scenario_;
    std::unique_ptr<SceneModel> model_;
    std::deque<CameraPoseEstimator> cameras_;  ///< they do not move
    std::vector<LidarPoseEstimator> lidars_;

    std::mutex mutex_;  ///< of what follows
    std::optional<StateEstimator> estimator_;
    std::optional<Guidance> guidance_;
    std::optional<FlightControl> control_;
    std::vector<MeasurementRecord> measurements_;
    DynamicsPhase dynamics_ = DynamicsPhase::flying;
    std::uint8_t frames_ = 0, sweeps_ = 0;
    std::uint32_t cycle_ = 0;
};

}  // namespace narpa::rehearsal
