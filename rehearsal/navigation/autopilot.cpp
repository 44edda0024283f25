#include "rehearsal/navigation/autopilot.h"

#include <cassert>
#include <cmath>
#include <utility>

namespace narpa::rehearsal {
Result<std::unique_ptr<Autopilot>> Autopilot::create(const Scenario& scenario, std::uint64_t seed) {
    std::unique_ptr<Autopilot> a(new Autopilot);
    a->scenario_ = scenario;
    auto model = SceneModel::create(scenario);
    if (!model) return model.error();
    a->model_ = *std::move(model);
    const CameraMethod& method = *scenario.navigation.camera_method;
    if (!a->model_->cameras().empty())
        if (Status good = check_method(method, a->model_->scene(), a->model_->target()); !good) return good.error();
    for (const std::size_t camera : a->model_->cameras())
        a->cameras_.emplace_back(*a->model_, camera, method, seed);
    for (const std::size_t lidar : a->model_->lidars()) a->lidars_.emplace_back(*a->model_, lidar);
    for (const std::size_t lidar : a->model_->velocimeters())
        a->velocimeters_.emplace_back(*a->model_, lidar, scenario.navigation);
    return a;
}

Status Autopilot::start(std::int64_t t_start_ns, const AttitudeReport& attitude) {
    auto estimator = StateEstimator::create(scenario_, t_start_ns, attitude);
    if (!estimator) return estimator.error();
    const std::lock_guard lock(mutex_);
    estimator_.emplace(*std::move(estimator));
    guidance_.emplace(scenario_, 0);
    control_.emplace(scenario_);
    return Ok{};
}

void Autopilot::take(const AttitudeReport& report) {
    const std::lock_guard lock(mutex_);
    estimator_->take(report);
}

void Autopilot::take(DynamicsPhase phase, std::int64_t t_ns) {
    const std::lock_guard lock(mutex_);
    if (phase == dynamics_) return;
    const DynamicsPhase before = std::exchange(dynamics_, phase);
    const auto on_ground = [](DynamicsPhase p) {
        return p == DynamicsPhase::touched_down || p == DynamicsPhase::landed || p == DynamicsPhase::crashed;
    };
    if (phase == DynamicsPhase::captured || phase == DynamicsPhase::bounced)
        estimator_->on_contact(t_ns, phase == DynamicsPhase::captured);
    if (on_ground(phase) && !on_ground(before)) estimator_->on_touchdown(t_ns);
}

Prediction Autopilot::predict(std::int64_t t_ns) {
    const std::lock_guard lock(mutex_);
    if (t_ns > estimator_->t_ns()) estimator_->advance(t_ns);
    const TargetEstimate known = estimator_->estimate();
    return {estimator_->t_s(t_ns),
            estimator_->attitude(t_ns).q_world_chaser,
            estimator_->predicted(t_ns),
            estimator_->motion_in_chaser(),
            position_sigma(known.covariance),
            rotation_sigma(known.covariance)};
}

void Autopilot::take_frame(std::size_t camera, std::int64_t t_ns, std::span<const std::uint8_t> bytes) {
    assert(camera < cameras_.size());
    CameraPoseEstimator& estimator = cameras_[camera];
    take(estimator.camera().name, t_ns, estimator.measure(bytes, t_ns, predict(t_ns)), frames_);
}

void Autopilot::take_sweep(std::size_t lidar, std::int64_t t_ns, LidarSweep sweep) {
    assert(lidar < lidars_.size());
    LidarPoseEstimator& estimator = lidars_[lidar];
    for (RangePoint& point : sweep.points) point.range_m += scenario_.model_error.error.range_bias_m;
    take(estimator.lidar().name, t_ns, estimator.measure(std::move(sweep), t_ns, predict(t_ns)), sweeps_);
}

void Autopilot::take_beam(const LidarBeamReport& report) {
    for (Velocimeter& velocimeter : velocimeters_) {
        if (velocimeter.index() != report.lidar) continue;
        const std::lock_guard lock(mutex_);
        const auto note = [&](const UpdateResult& result) {
            measurements_.push_back({velocimeter.lidar().name, report.t_ns,
                                     static_cast<MeasurementRecord::Outcome>(result.outcome), result.nis,
                                     result.why, 1, 0});
        };
        if (scenario_.orbit.model->over_ground) {
            const double sigma_m = position_sigma(estimator_->estimate().covariance);
            if (const auto range = velocimeter.measure_range(report, estimator_->predicted(report.t_ns), sigma_m)) {
                const UpdateResult result = estimator_->take(*range);
                note(result);
                if (result.outcome == UpdateOutcome::taken && sweeps_ < 255) ++sweeps_;
            }
        }
        const auto shot = velocimeter.measure(report, estimator_->predicted(report.t_ns));
        if (!shot) return;
        if (const auto result = estimator_->take(*shot)) note(*result);
    }
}

void Autopilot::take(const std::string& sensor, std::int64_t t_ns, const MeasurementResult& measurement,
                     std::uint8_t& count) {
    MeasurementRecord record{sensor,
                             t_ns,
                             MeasurementRecord::Outcome::no_pose,
                             0,
                             measurement.why,
                             measurement.points,
                             measurement.ms,
                             measurement.answer};
    const std::lock_guard lock(mutex_);
    if (measurement.pose) {
        TargetMeasurement pose = *measurement.pose;
        pose.t_ns += std::llround(1e9 * scenario_.model_error.error.clock_s);
        const UpdateResult result = estimator_->take(pose);
        record.outcome = static_cast<MeasurementRecord::Outcome>(result.outcome);
        record.nis = result.nis;
        if (result.outcome != UpdateOutcome::taken) record.why = result.why;
        if (result.outcome == UpdateOutcome::taken && count < 255) ++count;
    }
    measurements_.push_back(std::move(record));
}

CycleRecord Autopilot::cycle(std::int64_t t_ns, std::int64_t lead_ns) {
    assert(estimator_ && guidance_ && control_);
    const std::lock_guard lock(mutex_);
    CycleRecord out;
    estimator_->advance(t_ns);
    const RelativeMotion motion = estimator_->motion();
    const TargetEstimate known = estimator_->estimate();
    out.t_s = estimator_->t_s(t_ns);
    out.port = port_state(motion, scenario_.target, scenario_.chaser);
    out.position_sigma_m = position_sigma(known.covariance);

    const double unmeasured_s = 1e-9 * static_cast<double>(t_ns - estimator_->taken_ns());
    guidance_->step({out.t_s, out.port.T_port_chaser_port.t, out.port.velocity_m_s, out.position_sigma_m,
                     unmeasured_s, dynamics_});
    out.reference = guidance_->reference(out.t_s);
    Impulses impulses;
    if (guidance_->thrusters_off()) {
        control_->reset();
    } else {
        control_->set_mass(estimator_->mass_kg());
        impulses = control_->step(out.t_s, motion, out.reference);
    }
    estimator_->thrust(t_ns + lead_ns, impulses.linear_n_s);

    const auto sigma = [&](int i) { return std::sqrt(known.covariance(i, i)); };
    out.estimate = {
        cycle_,  t_ns,   known.T_chaser_target, {sigma(0), sigma(1), sigma(2)}, {sigma(3), sigma(4), sigma(5)},
        frames_, sweeps_};
    out.command = {static_cast<std::uint8_t>(cycle_),
                   t_ns + lead_ns,
                   impulses.linear_n_s,
                   impulses.angular_n_m_s,
                   guidance_->phase(),
                   static_cast<std::uint8_t>(guidance_->leg()),
                   guidance_->abort()};
    out.measurements = std::exchange(measurements_, {});
    frames_ = sweeps_ = 0;
    ++cycle_;
    return out;
}

}  // namespace narpa::rehearsal
