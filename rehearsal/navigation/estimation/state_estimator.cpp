#include "rehearsal/navigation/estimation/state_estimator.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "estimator/uncertainty/root_information.h"

namespace narpa::rehearsal {

bool AttitudeTrack::take(const AttitudeReport& report) noexcept {
    if (count_ > 0 && report.t_ns <= newest().t_ns) return false;
    if (count_ == reports_.size()) {
        std::move(reports_.begin() + 1, reports_.end(), reports_.begin());
        --count_;
    }
    reports_[count_++] = report;
    return true;
}

AttitudeTrack::At AttitudeTrack::at(std::int64_t t_ns) const noexcept {
    assert(!empty());
    std::size_t after = 0;
    while (after < count_ && reports_[after].t_ns < t_ns) ++after;
    if (after > 0 && after < count_) {
        const AttitudeReport &a = reports_[after - 1], &b = reports_[after];
        const double u = static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
        return {slerp(a.q_world_chaser, b.q_world_chaser, u), (1 - u) * a.rate_rad_s + u * b.rate_rad_s};
    }
    const AttitudeReport& nearest = reports_[after == 0 ? 0 : count_ - 1];
    const double off_s = 1e-9 * static_cast<double>(t_ns - nearest.t_ns);
    return {normalized(nearest.q_world_chaser * exp_rotation(off_s * nearest.rate_rad_s)), nearest.rate_rad_s};
}

double AttitudeTrack::share_of_newest(std::int64_t t_ns) const noexcept {
    if (count_ < 2 || t_ns >= newest().t_ns) return 1;
    const std::int64_t last_ns = reports_[count_ - 2].t_ns;
    return std::max(0.0, static_cast<double>(t_ns - last_ns) / static_cast<double>(newest().t_ns - last_ns));
}

bool AttitudeTrack::has(std::int64_t t_ns) const noexcept {
    return std::ranges::any_of(std::span(reports_).first(count_), [&](const AttitudeReport& report) {
        return std::abs(report.t_ns - t_ns) <= 1'000'000;
    });
}

namespace {

/// Covers a minute of measurements and pulse edges.
constexpr std::size_t kHistory = 256;
constexpr std::uint64_t kContradictions = 5;
/// Standard deviations of velocity and rate when the filter restarts.
constexpr double kRestartVelocity_m_s = 0.2, kRestartRate_rad_s = 0.2 * kDegree;
/// Standard deviations added at contact.
constexpr double kMetPosition_m = 0.05, kMetAttitude_rad = 0.3 * kDegree, kMetRate_rad_s = 0.1 * kDegree,
                 kHeldVelocity_m_s = 0.01, kBouncedVelocity_m_s = 0.2;
constexpr double kGravity0_m_s2 = 9.80665;  ///< standard gravity, for specific impulses
/// Lower bounds of the standard deviations at the start.
constexpr double kMinPosition_m = 0.01, kMinVelocity_m_s = 1e-3, kMinAttitude_rad = 0.1 * kDegree,
                 kMinRate_rad_s = 2e-3 * kDegree;

/// Standard deviations of the map's attitude relative to the stars, and of the planet's rotation rate.
constexpr double kGroundAttitude_rad = 1e-5, kGroundRate_rad_s = 1e-9;

/// A star tracker's error rotates the target about the chaser.
Eigen::Matrix<double, 6, 3> star_tracker_jacobian(const Vec3& target_from_chaser_m) {
    Eigen::Matrix<double, 6, 3> J;
    J << Eigen::Matrix3d::Identity(), -skew(to_eigen(target_from_chaser_m));
    return J;
}

/// Covariance of a pose due to that error.
Matrix6 star_tracker_covariance(const Vec3& target_from_chaser_m, double sigma_rad) {
    const auto J = star_tracker_jacobian(target_from_chaser_m);
    return sigma_rad * sigma_rad * J * J.transpose();
}

/// The same Jacobian for the filter's state, as if it were measured directly.
Eigen::Matrix<double, 12, 3> star_tracker_jacobian(const RelativeState& state, const Quat& q_frame_chaser) {
    Eigen::Matrix<double, 12, 3> J = Eigen::Matrix<double, 12, 3>::Zero();
    const Eigen::Matrix3d R = rotation_matrix(q_frame_chaser);
    J.middleRows<3>(0) = -skew(to_eigen(state.position_m)) * R;
    J.middleRows<3>(6) = rotation_matrix(conjugate(state.q_frame_target)) * R;
    return J;
}

/// Covariance of independent errors with standard deviations of at least `least`, along axes rotated by q.
Eigen::Matrix3d spread(const Quat& q, const Vec3& sigma, double least) {
    Eigen::Vector3d variance;
    for (int i = 0; i < 3; ++i) variance[i] = std::pow(std::max(sigma[i], least), 2);
    const Eigen::Matrix3d R = rotation_matrix(q);
    return R * variance.asDiagonal() * R.transpose();
}

FilterSettings filter_settings(const Scenario& s) {
    FilterSettings f;
    f.history = kHistory;
    f.motion.orbit_rate_rad_s = s.orbit.rate_rad_s();
    if (s.orbit.model->over_ground) f.motion.ground = ground_field(s.orbit);
    if (!s.target_motion.with_lvlh) f.motion.inertia_kg_m2 = s.target.inertia_kg_m2;
    f.motion.acceleration_psd = s.navigation.acceleration_psd;
    f.motion.angular_acceleration_psd = s.navigation.angular_acceleration_psd;
    return f;
}

Matrix12 first_covariance(const Scenario& s, const RelativeMotion& motion) {
    const Quat q_frame_port = conjugate(s.orbit.q_world_frame(0)) * motion.q_world_target * s.target.T_body_port.q;
    const Quat q_target_chaser_port =
        conjugate(motion.q_world_target) * motion.q_world_chaser * s.chaser.T_body_port.q;
    Matrix12 P = Matrix12::Zero();
    P.block<3, 3>(0, 0) = spread(q_frame_port, s.start.position_sigma_m, kMinPosition_m);
    P.block<3, 3>(3, 3) = spread(q_frame_port, s.start.velocity_sigma_m_s, kMinVelocity_m_s);
    if (s.orbit.model->over_ground) {  // the planet's rotation is known; the chaser's attitude is measured
        P.block<3, 3>(6, 6) = kGroundAttitude_rad * kGroundAttitude_rad * Eigen::Matrix3d::Identity();
        P.block<3, 3>(9, 9) = kGroundRate_rad_s * kGroundRate_rad_s * Eigen::Matrix3d::Identity();
        return 0.5 * (P + P.transpose());
    }
    P.block<3, 3>(6, 6) = spread(q_target_chaser_port, kDegree * s.start.attitude_sigma_deg, kMinAttitude_rad);
    P.block<3, 3>(9, 9) = spread(conjugate(motion.q_world_target) * motion.q_world_chaser,
                                 kDegree * s.start.rate_sigma_deg_s, kMinRate_rad_s);
    return 0.5 * (P + P.transpose());
}

}  // namespace

PoseMeasurement at_centres_of_mass(const TargetMeasurement& s, const Vec3& chaser_centre_m,
                                   const Vec3& target_centre_m, const Quat& q_frame_chaser,
                                   double attitude_sigma_rad) {
    const Rigid3 T_target_mass{{}, target_centre_m};
    PoseMeasurement m;
    m.t_ns = s.t_ns;
    m.T_sensor_target = s.T_sensor_target * T_target_mass;
    m.T_chaser_sensor = {s.T_chaser_sensor.q, s.T_chaser_sensor.t - chaser_centre_m};
    m.q_frame_chaser = q_frame_chaser;
    const Vec3 from_chaser = conjugate(m.T_chaser_sensor.q) * (m.T_chaser_sensor * m.T_sensor_target.t);
    if (s.root_information) {
        m.root_information = root_information_with(
            root_information_of_product(s.T_sensor_target, *s.root_information, T_target_mass),
            attitude_sigma_rad * star_tracker_jacobian(from_chaser));
        return m;
    }
    m.covariance = covariance_of_product(s.T_sensor_target, s.covariance, T_target_mass) +
                   star_tracker_covariance(from_chaser, attitude_sigma_rad);
    m.covariance = (0.5 * (m.covariance + m.covariance.transpose())).eval();
    return m;
}

Result<StateEstimator> StateEstimator::create(const Scenario& s, std::int64_t t_start_ns,
                                              const AttitudeReport& attitude) {
    RelativeMotion nominal;
    nominal.q_world_target = s.q_world_target;
    nominal.target_rate_rad_s = nominal_target_rate_rad_s(s);
    nominal.q_world_chaser = attitude.q_world_chaser;
    nominal.chaser_rate_rad_s = attitude.rate_rad_s;
    place_port(s.start.position_m, s.start.velocity_m_s, s.target, s.chaser, nominal);
    PoseTracker tracker({filter_settings(s), kRestartVelocity_m_s, kRestartRate_rad_s, kContradictions});
    if (auto good = tracker.start(t_start_ns, in_frame(nominal, s.orbit, 0), first_covariance(s, nominal)); !good)
        return good.error();
    StateEstimator made(s, t_start_ns, std::move(tracker));
    made.take(attitude);
    return made;
}

Quat StateEstimator::q_frame_chaser(std::int64_t t_ns) const {
    return normalized(conjugate(scenario_.orbit.q_world_frame(t_s(t_ns))) * attitude_.at(t_ns).q_world_chaser);
}

void StateEstimator::thrust(std::int64_t t_ns, const Vec3& impulse_n_s) {
    if (t_ns <= this->t_ns()) advance(t_ns);
    std::erase_if(pulses_, [&](const Pulse& p) { return p.from_ns >= t_ns || resting_; });
    if (resting_) return;
    const Thrusters& thrusters = scenario_.thrusters;
    const std::optional<Engine>& engine = scenario_.engine;
    const double sigma = std::hypot(thrusters.gain_sigma, kDegree * thrusters.misalignment_sigma_deg);
    // An engine burns for the whole period, during which the chaser may rotate: uses its attitude at mid-period.
    const std::int64_t period_ns = scenario_.period_ns();
    const Quat q = q_frame_chaser(engine ? t_ns + period_ns / 2 : t_ns);
    const auto burns = [&](int axis) { return engine && axis == engine->axis() && impulse_n_s[axis] != 0; };
    const double engine_sigma =
        engine ? std::hypot(engine->gain_sigma, kDegree * thrusters.misalignment_sigma_deg) : 0;
    // The pulses of the three axes end at different times; the force is constant between two of these.
    std::array<std::int64_t, 4> edges{t_ns, t_ns, t_ns, t_ns};
    for (int i = 0; i < 3; ++i)
        edges[static_cast<std::size_t>(i + 1)] +=
            burns(i) ? period_ns : std::llround(1e9 * std::abs(impulse_n_s[i]) / thrusters.force_n);
    const auto ends = edges;
    std::ranges::sort(edges);
    for (const std::int64_t from_ns : edges) {
        Vec3 force;
        for (int i = 0; i < 3; ++i)
            if (from_ns < ends[static_cast<std::size_t>(i + 1)])
                force[i] = burns(i) ? 1e9 * impulse_n_s[i] / static_cast<double>(period_ns)
                                    : std::copysign(thrusters.force_n, impulse_n_s[i]);
        // A pulse of on-time T and relative error s spreads the velocity by (s dv)^2 = psd T.
        double error2 = 0;
        for (int i = 0; i < 3; ++i)
            if (force[i] != 0) {
                const double on_s = 1e-9 * static_cast<double>(ends[static_cast<std::size_t>(i + 1)] - t_ns);
                const double part = burns(i) ? engine_sigma : sigma;
                error2 += std::pow(part * force[i] / mass_kg_, 2) * on_s;
            }
        pulses_.push_back({from_ns, -(q * force) / mass_kg_, error2});
    }
    if (engine && engine->specific_impulse_s > 0)
        mass_kg_ -= std::max(0.0, engine->sign() * impulse_n_s[engine->axis()]) /
                    (engine->specific_impulse_s * kGravity0_m_s2);
    if (t_ns <= this->t_ns()) advance(t_ns);
}

void StateEstimator::advance(std::int64_t t_ns) {
    while (!pulses_.empty() && pulses_.front().from_ns <= t_ns) {
        const Pulse pulse = pulses_.front();
        pulses_.pop_front();
        if (!pulses_.empty() && pulses_.front().from_ns == pulse.from_ns) continue;
        tracker_.filter().accelerate(pulse.from_ns, pulse.acceleration_m_s2, pulse.psd);
    }
    tracker_.filter().predict(t_ns);
}

/// Restarts the filter with the chaser's port at this place and velocity, and with `more` added to its covariance
/// (standard deviations).
void StateEstimator::restart_at(const Vec3& port_m, const Vec3& port_velocity_m_s, const Vector12& more) {
    pulses_.clear();
    by_star_tracker_.setZero();
    RelativeMotion m = motion();
    place_port(port_m, port_velocity_m_s, scenario_.target, scenario_.chaser, m);
    const Matrix12 covariance = filter().covariance() + Matrix12(more.cwiseAbs2().asDiagonal());
    // If that fails, the filter stays unchanged.
    (void)tracker_.start(t_ns(), in_frame(m, scenario_.orbit, t_s(t_ns())), covariance);
}

void StateEstimator::on_contact(std::int64_t t_ns, bool held) {
    advance(t_ns);
    const PortState port = port_state(motion(), scenario_.target, scenario_.chaser);
    const Vec3 at = port.position_m(), along = port.velocity_m_s;
    Vector12 more;
    more << Eigen::Vector3d::Constant(kMetPosition_m),
        Eigen::Vector3d::Constant(held ? kHeldVelocity_m_s : kBouncedVelocity_m_s),
        Eigen::Vector3d::Constant(kMetAttitude_rad), Eigen::Vector3d::Constant(kMetRate_rad_s);
    restart_at({held ? 0 : at.x, at.y, at.z}, held ? Vec3{} : Vec3{0, along.y, along.z}, more);
}

void StateEstimator::on_touchdown(std::int64_t t_ns) {
    advance(t_ns);
    Vector12 more = Vector12::Zero();
    more.segment<3>(0).setConstant(kMetPosition_m);
    more.segment<3>(3).setConstant(kBouncedVelocity_m_s);
    restart_at(port_state(motion(), scenario_.target, scenario_.chaser).position_m(), {}, more);
    // The ground compensates gravity.
    tracker_.filter().accelerate(this->t_ns(), ground_field(scenario_.orbit).gravity_m_s2);
    resting_ = true;
}

UpdateResult StateEstimator::take(const TargetMeasurement& measurement) {
    if (measurement.t_ns > t_ns()) advance(measurement.t_ns);
    const Matrix12 before = filter().covariance();
    const std::uint64_t restarts = tracker_.restarts();
    const PoseMeasurement m = at_centres_of_mass(
        measurement, scenario_.chaser.centre_of_mass_m, scenario_.target.centre_of_mass_m,
        q_frame_chaser(measurement.t_ns), kDegree * scenario_.attitude_sensor.attitude_sigma_deg);
    const UpdateResult result = tracker_.update(m);
    if (result.outcome != UpdateOutcome::taken) return result;
    taken_ns_ = std::max(taken_ns_, measurement.t_ns);
    Matrix6 turn = Matrix6::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = rotation_matrix(measurement.T_chaser_sensor.q);
    by_model_ = turn * measurement.covariance_of_model * turn.transpose();
    if (tracker_.restarts() != restarts)
        by_star_tracker_.setZero();
    else
        correlate(before, attitude_.share_of_newest(measurement.t_ns));
    return result;
}

/// Call after an update of the filter whose covariance was `before`. With gain K and measurement Jacobian H, I - K
/// H is covariance * before^-1, and K H is the part of the star tracker's error that the state takes over. The
/// filter takes the errors of several measurements by one report as independent, so its covariance does not include
/// their sum: only the one with the largest weight is kept.
void StateEstimator::correlate(const Matrix12& before, double share) {
    const Matrix12 kept = before.ldlt().solve(filter().covariance()).transpose();
    const auto J = star_tracker_jacobian(filter().state(), q_frame_chaser(t_ns()));
    const Eigen::Matrix<double, 12, 3> by_earlier = kept * by_star_tracker_, by_this = share * (J - kept * J);
    const auto turn = [](const auto& by) { return by.template middleRows<3>(6).norm(); };
    by_star_tracker_ = turn(by_this) > turn(by_earlier) ? by_this : by_earlier;
}

UpdateResult StateEstimator::take(const TargetRange& r) {
    if (r.t_ns > t_ns()) advance(r.t_ns);
    const Vec3 origin = r.origin_m - scenario_.chaser.centre_of_mass_m;
    const UpdateResult result = tracker_.update(BeamRange{
        .t_ns = r.t_ns,
        .origin_m = origin,
        .direction = r.direction,
        .point_m = r.point_m - scenario_.target.centre_of_mass_m,
        .normal = r.normal,
        .range_m = r.range_m,
        .sigma_m = std::hypot(r.sigma_m, kDegree * scenario_.attitude_sensor.attitude_sigma_deg * r.range_m),
        .q_frame_chaser = q_frame_chaser(r.t_ns)});
    if (result.outcome == UpdateOutcome::taken) taken_ns_ = std::max(taken_ns_, r.t_ns);
    return result;
}

std::optional<UpdateResult> StateEstimator::take(const TargetVelocity& v) {
    if (!attitude_.has(v.t_ns)) return std::nullopt;
    if (v.t_ns > t_ns()) advance(v.t_ns);
    const AttitudeTrack::At chaser = attitude_.at(v.t_ns);
    const Vec3 origin = v.origin_m - scenario_.chaser.centre_of_mass_m;
    // The star tracker's error rotates the beam; over ground this adds a part of the velocity across the beam.
    const double across_m_s = scenario_.orbit.model->over_ground ? norm(filter().state().velocity_m_s) : 0;
    return tracker_.update(BeamVelocity{
        .t_ns = v.t_ns,
        .origin_m = origin,
        .direction = v.direction,
        .point_m = origin + v.range_m * v.direction,
        .velocity_m_s = v.velocity_m_s,
        .sigma_m_s = std::hypot(v.sigma_m_s, kDegree * scenario_.attitude_sensor.rate_sigma_deg_s * norm(origin),
                                kDegree * scenario_.attitude_sensor.attitude_sigma_deg * across_m_s),
        .q_frame_chaser = q_frame_chaser(v.t_ns),
        .chaser_rate_rad_s = chaser.rate_rad_s});
}

RelativeMotion StateEstimator::motion() const {
    const AttitudeTrack::At now = attitude_.at(t_ns());
    return in_world(filter().state(), scenario_.orbit, t_s(t_ns()), now.q_world_chaser, now.rate_rad_s);
}

/// Limits the shared error to a part of the state's variance in any direction: linearisation at different poses
/// could make it exceed the variance where the star tracker's error dominates.
Eigen::Matrix<double, 12, 3> StateEstimator::by_star_tracker(double sigma_rad) const {
    constexpr double kMaxShared = 0.95;
    const Eigen::Matrix3d shared =
        sigma_rad * sigma_rad * by_star_tracker_.transpose() * filter().covariance().ldlt().solve(by_star_tracker_);
    const double most =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(shared, Eigen::EigenvaluesOnly).eigenvalues()[2];
    return std::sqrt(kMaxShared / std::max(most, kMaxShared)) * by_star_tracker_;
}

TargetEstimate StateEstimator::estimate() const {
    const Quat q = q_frame_chaser(t_ns());
    const PoseFilter::Pose pose = filter().pose(q);
    const Rigid3 T_mass_target{{}, -scenario_.target.centre_of_mass_m};
    const double sigma_rad = kDegree * scenario_.attitude_sensor.attitude_sigma_deg;
    // Rotating the state to the chaser's axes adds the star tracker's error, and cancels the part of that error
    // that entered with the measurements.
    const auto by = by_star_tracker(sigma_rad);
    Eigen::Matrix<double, 6, 3> known;
    known << rotation_matrix(conjugate(q) * filter().state().q_frame_target) * by.middleRows<3>(6),
        rotation_matrix(conjugate(q)) * by.middleRows<3>(0);
    const Matrix6 both = sigma_rad * sigma_rad * known * star_tracker_jacobian(pose.T_chaser_target.t).transpose();
    const Matrix6 covariance =
        pose.covariance + star_tracker_covariance(pose.T_chaser_target.t, sigma_rad) - both - both.transpose();
    // The chaser's centre of mass only shifts the origin: the covariance is the same.
    const Rigid3 T = Rigid3{{}, scenario_.chaser.centre_of_mass_m} * pose.T_chaser_target * T_mass_target;
    TargetEstimate out{
        T, covariance_of_product(pose.T_chaser_target, covariance, T_mass_target) + covariance_of_model(T)};
    // The filter's position is relative to the map, whose error below the chaser is the same for many measurements.
    const Eigen::Vector3d map_error =
        scenario_.navigation.map_sigma_m * to_eigen(T.q * (scenario_.target.T_body_port.q * Vec3{1, 0, 0}));
    out.covariance.bottomRightCorner<3, 3>() += map_error * map_error.transpose();
    return out;
}

/// Model errors are common to all measurements: they do not average out, and the filter's own covariance does not
/// include them. If only beams were measured, no pose: approximately their effect on a pose.
Matrix6 StateEstimator::covariance_of_model(const Rigid3& T_chaser_target) const {
    if (by_model_) return *by_model_;
    ModelUncertainty u = scenario_.model_error.uncertainty();
    if (u == ModelUncertainty{}) return Matrix6::Zero();
    // A focal length error acts like a size error, and a range bias at most like a shift.
    u.scale = std::hypot(u.scale, u.focal), u.focal = 0;
    u.mesh_m = std::hypot(u.mesh_m, u.range_bias_m);
    return covariance_by(image_shifts(u, T_chaser_target, motion_in_chaser()));
}

Rigid3 StateEstimator::predicted(std::int64_t t_ns) const {
    const double by_s = 1e-9 * static_cast<double>(t_ns - filter().t_ns());
    RelativeState state = filter().state();
    const Vec3 turn = state.rate_rad_s - conjugate(state.q_frame_target) * Vec3{0, 0, scenario_.orbit.rate_rad_s()};
    state.position_m = state.position_m + by_s * state.velocity_m_s;
    state.q_frame_target = normalized(state.q_frame_target * exp_rotation(by_s * turn));
    const Quat q_chaser_frame = conjugate(q_frame_chaser(t_ns));
    return Rigid3{q_chaser_frame, scenario_.chaser.centre_of_mass_m} *
           Rigid3{state.q_frame_target, state.position_m} * Rigid3{{}, -scenario_.target.centre_of_mass_m};
}

ApparentMotion StateEstimator::motion_in_chaser() const {
    const RelativeMotion m = motion();
    const Quat q_chaser_world = conjugate(m.q_world_chaser);
    const Vec3 target_rate = m.q_world_target * m.target_rate_rad_s;
    const Vec3 origin = -(m.q_world_target * scenario_.target.centre_of_mass_m);
    const Vec3 velocity = q_chaser_world * (cross(target_rate, origin) - m.velocity_m_s);
    return {velocity - cross(m.chaser_rate_rad_s, q_chaser_world * (origin - m.position_m)),
            q_chaser_world * target_rate - m.chaser_rate_rad_s};
}

}  // namespace narpa::rehearsal
