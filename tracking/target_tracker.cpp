#include "tracking/target_tracker.h"

#include <fmt/format.h>

#include <cmath>

#include "estimator/cloud/cloud_icp.h"

namespace narpa {
namespace {

/// Initial standard deviations of velocity and rate, until the second frame.
constexpr double kFirstVelocity_m_s = 1, kFirstRate_rad_s = 0.1;
/// Standard deviations beyond which the target counts as lost, because a render would not match the frame.
/// kLostShift is a fraction of the range.
constexpr double kLostTurn_rad = 0.5, kLostShift = 0.2;

PoseTrackerSettings tracker_settings(const TrackerOptions& options) {
    PoseTrackerSettings settings;
    settings.filter.motion.acceleration_psd = options.acceleration_psd;
    settings.filter.motion.angular_acceleration_psd = options.angular_acceleration_psd;
    settings.first_velocity_m_s = kFirstVelocity_m_s;
    settings.first_rate_rad_s = kFirstRate_rad_s;
    return settings;
}

/// The pose is accurate enough to start an estimate.
bool is_tracked(const PoseFilter::Pose& known) {
    return rotation_sigma(known.covariance) < kLostTurn_rad &&
           position_sigma(known.covariance) < kLostShift * norm(known.T_chaser_target.t);
}

}  // namespace

Result<std::size_t> target_of(const World& world, int mount, std::string_view sensor, const std::string& name) {
    const auto& bodies = world.scene().bodies;
    if (!name.empty()) {
        if (const auto body = world.body_named(name)) {
            if (static_cast<int>(*body) != mount) return *body;
            return Error{fmt::format("target \"{}\" carries \"{}\", expected another body", name, sensor),
                         world.scene().file};
        }
        std::string names;
        for (const Body& b : bodies) names += (names.empty() ? "" : ", ") + b.name;
        return Error{fmt::format("no body named \"{}\" to estimate the pose of, expected one of: {}", name, names),
                     world.scene().file};
    }
    for (std::size_t i = 0; i < bodies.size(); ++i)
        if (static_cast<int>(i) != mount && std::holds_alternative<int>(bodies[i].shape)) return i;
    return Error{
        fmt::format(
            "no body with a mesh but what carries \"{}\": expected one to estimate the pose of, or its name",
            sensor),
        world.scene().file};
}

Rigid3 displaced_truth(const Rigid3& truth, const TrackerOptions& o, std::mt19937_64& random) {
    return displaced(truth, random_error(o.start_deg * kDegree, 0.01 * o.start_percent * norm(truth.t), random));
}

Matrix6 start_covariance(const TrackerOptions& o, double range_m) {
    Vector6 sigma;
    sigma << Eigen::Vector3d::Constant(o.start_deg * kDegree),
        Eigen::Vector3d::Constant(0.01 * o.start_percent * range_m);
    return Matrix6(sigma.cwiseAbs2().asDiagonal()) / 3;
}

EstimateReport TrackedFrame::report(std::uint8_t camera) const {
    const auto deviation = [&](int i) { return std::sqrt(filtered_covariance(i, i)); };
    return {frame,
            camera,
            state,
            answer.kind,
            t_ns,
            filtered,
            {deviation(0), deviation(1), deviation(2)},
            {deviation(3), deviation(4), deviation(5)}};
}

void TrackedFrame::take(const Answer& estimated, const Rigid3& pose, const Matrix6& its_covariance,
                        const Matrix6& of_model) {
    answer = estimated;
    why = estimated.why;
    if (!estimated.usable()) return;
    measured = pose;
    covariance = its_covariance;
    covariance_of_model = of_model;
}

TargetTracker::TargetTracker(const TrackerOptions& options)
    : options_(options), random_(options.seed), tracker_(tracker_settings(options)) {}

void TargetTracker::predict(std::int64_t t_ns, const Quat& q_frame_chaser) {
    if (!started()) return;
    tracker_.filter().predict(t_ns);
    if (!is_tracked(filter().pose(q_frame_chaser))) tracker_.stop();
}

Rigid3 TargetTracker::guess(const Rigid3& T_chaser_sensor, const Quat& q_frame_chaser, const Rigid3& truth) {
    if (predicts()) return inverse(T_chaser_sensor) * filter().pose(q_frame_chaser).T_chaser_target;
    return options_.guess ? *options_.guess : displaced_truth(truth, options_, random_);
}

Matrix6 TargetTracker::guess_covariance(const Rigid3& T_chaser_sensor, const Quat& q_frame_chaser,
                                        const Rigid3& guess) const {
    if (!predicts()) return start_covariance(options_, norm(guess.t));
    return covariance_in_other_axes(conjugate(T_chaser_sensor.q), filter().pose(q_frame_chaser).covariance) +
           covariance_of_model_;
}

double TargetTracker::search_radius_m(double range_m, double reach_m) const {
    if (!predicts()) return 0.01 * options_.start_percent * range_m + options_.start_deg * kDegree * reach_m;
    const Matrix6 known = filter().pose({}).covariance;  // its size is the same in all axes
    return narpa::search_radius_m(position_sigma(known), rotation_sigma(known), reach_m);
}

ApparentMotion TargetTracker::motion(const Rigid3& T_chaser_sensor, const Rigid3& T_sensor_target,
                                     const std::array<Quat, 3>& q_frame_chaser, double length_s) const {
    const Quat q_middle = q_frame_chaser[1];
    const Rigid3 T_chaser_target = T_chaser_sensor * T_sensor_target;
    const auto known = started() ? filter().state() : RelativeState{};
    const auto at_time = [&](const Quat& q_frame_chaser_then, double t_s) {
        const Quat q = conjugate(q_frame_chaser_then);
        const Rigid3 T{normalized(q * q_middle * T_chaser_target.q * exp_rotation(t_s * known.rate_rad_s)),
                       q * (q_middle * T_chaser_target.t + t_s * known.velocity_m_s)};
        return inverse(T_chaser_sensor) * T;
    };
    return motion_between(at_time(q_frame_chaser[0], -0.5 * length_s), at_time(q_frame_chaser[2], 0.5 * length_s),
                          length_s);
}

void TargetTracker::update(const Rigid3& T_chaser_sensor, const Quat& q_frame_chaser, bool knows_guess,
                           TrackedFrame& out) {
    if (out.measured) {
        // The model's errors are common to all measurements, so the filter gets the covariance without them.
        PoseMeasurement measurement{out.t_ns, *out.measured, out.covariance - out.covariance_of_model,
                                    T_chaser_sensor, q_frame_chaser};
        if (out.answer.kind == AnswerKind::unobservable && (started() || !knows_guess))
            measurement.root_information = out.answer.root_information;
        const UpdateResult update = tracker_.update(measurement);
        out.nis = update.nis;
        if (update.outcome != UpdateOutcome::taken) out.why = update.why;
        if (update.outcome == UpdateOutcome::taken) {
            out.state = EstimateState::measured;
            covariance_of_model_ = out.covariance_of_model;
        }
    }
    if (!started()) return;
    // Chaser axes to sensor axes: the mounting is exact.
    const PoseFilter::Pose known = filter().pose(q_frame_chaser);
    const Rigid3 T_sensor_chaser = inverse(T_chaser_sensor);
    out.filtered = T_sensor_chaser * known.T_chaser_target;
    out.filtered_covariance = covariance_in_other_axes(T_sensor_chaser.q, known.covariance) + covariance_of_model_;
    if (out.state == EstimateState::lost) out.state = EstimateState::predicted;
}

}  // namespace narpa
