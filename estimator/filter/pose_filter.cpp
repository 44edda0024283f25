#include "estimator/filter/pose_filter.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

using Matrix6x12 = Eigen::Matrix<double, 6, 12>;

bool is_unit(const Quat& q) {
    return std::abs(norm(q) - 1) < 1e-6;
}

template <int N>
bool is_covariance(const UnalignedMatrix<N, N>& C) {
    if (!C.allFinite()) return false;
    if ((C - C.transpose()).cwiseAbs().maxCoeff() > 1e-9 * C.cwiseAbs().maxCoeff()) return false;
    return normalised_error_squared(UnalignedMatrix<N, 1>::Zero(), C) == 0;
}

/// Text on what is wrong with a measurement; null: nothing.
const char* fault(const PoseMeasurement& m) {
    if (!is_finite(m.T_sensor_target.t) || !is_finite(m.T_chaser_sensor.t)) return "expected finite positions";
    if (!is_unit(m.T_sensor_target.q) || !is_unit(m.T_chaser_sensor.q) || !is_unit(m.q_frame_chaser))
        return "expected quaternions of length 1";
    if (m.root_information)
        return m.root_information->allFinite() ? nullptr : "expected a finite root of the information";
    if (!is_covariance(m.covariance))
        return "expected a covariance that is finite, symmetric and positive definite";
    return nullptr;
}

const char* fault(const BeamVelocity& m) {
    if (!is_finite(m.origin_m) || !is_finite(m.point_m) || !is_finite(m.chaser_rate_rad_s))
        return "expected finite positions and rates";
    if (!is_unit(m.q_frame_chaser) || !(std::abs(norm(m.direction) - 1) < 1e-6))
        return "expected a quaternion and a direction of length 1";
    if (!std::isfinite(m.velocity_m_s) || !(m.sigma_m_s > 0 && std::isfinite(m.sigma_m_s)))
        return "expected a finite velocity with a standard deviation > 0";
    return nullptr;
}

const char* fault(const BeamRange& m) {
    if (!is_finite(m.origin_m) || !is_finite(m.point_m)) return "expected finite positions";
    if (!is_unit(m.q_frame_chaser) || !(std::abs(norm(m.direction) - 1) < 1e-6) ||
        !(std::abs(norm(m.normal) - 1) < 1e-6))
        return "expected a quaternion and directions of length 1";
    if (!std::isfinite(m.range_m) || !(m.sigma_m > 0 && std::isfinite(m.sigma_m)))
        return "expected a finite range with a standard deviation > 0";
    return nullptr;
}

/// Covariance of a measurement that observes all six motions; else 0.
Matrix6 covariance_of(const PoseMeasurement& m) {
    if (!m.root_information) return m.covariance;
    const Matrix6 root = inverse(*m.root_information);
    return root.allFinite() ? Matrix6(root * root.transpose()) : Matrix6(Matrix6::Zero());
}

/// Rotation from sensor axes to frame axes.
Quat q_frame_sensor(const PoseMeasurement& m) {
    return m.q_frame_chaser * m.T_chaser_sensor.q;
}

Rigid3 expected_pose(const RelativeState& state, const PoseMeasurement& m) {
    const Rigid3 T_chaser_target{conjugate(m.q_frame_chaser) * state.q_frame_target,
                                 conjugate(m.q_frame_chaser) * state.position_m};
    return inverse(m.T_chaser_sensor) * T_chaser_target;
}

/// Jacobian of a pose's error by the state's error; q_frame_axes takes the pose's axes to the frame's.
Matrix6x12 pose_jacobian(const Quat& q_frame_axes, const RelativeState& state) {
    Matrix6x12 H = Matrix6x12::Zero();
    H.block<3, 3>(0, 6) = rotation_matrix(conjugate(q_frame_axes) * state.q_frame_target);
    H.block<3, 3>(3, 0) = rotation_matrix(conjugate(q_frame_axes));
    return H;
}

/// Expected velocity along the beam, and its Jacobian by the state's error.
///
/// With w the frame's rate, W the target's, V the chaser's, L from the target's centre of mass to the point, all in
/// frame axes: u . (v + w x r + W x L - V x o).
std::pair<double, Eigen::Matrix<double, 1, 12>> expected_velocity(const RelativeState& state,
                                                                  double orbit_rate_rad_s, const BeamVelocity& m) {
    const Vec3 u = m.q_frame_chaser * m.direction, lever = m.q_frame_chaser * m.point_m - state.position_m;
    const Vec3 frame_rate{0, 0, orbit_rate_rad_s}, target_rate = state.q_frame_target * state.rate_rad_s;
    const Vec3 of_sensor = m.q_frame_chaser * cross(m.chaser_rate_rad_s, m.origin_m);
    const double velocity =
        dot(u, state.velocity_m_s + cross(frame_rate, state.position_m) + cross(target_rate, lever) - of_sensor);
    const Vec3 by_position = cross(u, frame_rate - target_rate);
    const Vec3 by_rate = conjugate(state.q_frame_target) * cross(lever, u);
    const Vec3 by_attitude = cross(state.rate_rad_s, by_rate);
    Eigen::Matrix<double, 1, 12> H;
    H << to_eigen(by_position).transpose(), to_eigen(u).transpose(), to_eigen(by_attitude).transpose(),
        to_eigen(by_rate).transpose();
    return {velocity, H};
}

/// Expected range along the beam, and its Jacobian by the state's error. With n the plane's normal, c its point
/// from the target's centre of mass, r that centre, all in frame axes: n . (r + c - o) / n . u.
std::pair<double, Eigen::Matrix<double, 1, 12>> expected_range(const RelativeState& state, const BeamRange& m) {
    const Vec3 u = m.q_frame_chaser * m.direction, origin = m.q_frame_chaser * m.origin_m;
    const Vec3 n = state.q_frame_target * m.normal, plane = state.q_frame_target * m.point_m;
    const double along = dot(n, u), range_m = dot(n, state.position_m + plane - origin) / along;
    const Vec3 by_position = n / along;
    // The plane turns about the target's centre: its point moves, and its normal turns about where the beam ends.
    const Vec3 met = origin + range_m * u - state.position_m;
    const Vec3 by_attitude = conjugate(state.q_frame_target) * cross(met, by_position);
    Eigen::Matrix<double, 1, 12> H = Eigen::Matrix<double, 1, 12>::Zero();
    H.segment<3>(0) = to_eigen(by_position).transpose();
    H.segment<3>(6) = to_eigen(by_attitude).transpose();
    return {range_m, H};
}

using Matrix1 = UnalignedMatrix<1, 1>;

/// A root W of the inverse: A^-1 = W' W.
Matrix6 root_of_inverse(const Matrix6& A) {
    return lower_solve(cholesky(A).L, Matrix6(Matrix6::Identity()));
}
Matrix1 root_of_inverse(const Matrix1& A) {
    return Matrix1(1 / std::sqrt(A.value()));
}

/// The innovation of a measurement of N numbers.
template <int N>
struct Innovation {
    Eigen::Matrix<double, N, 12> H;
    Eigen::Matrix<double, N, 1> z;
    UnalignedMatrix<N, N> R;                   ///< of the measurement
    Eigen::Matrix<double, 12, N> PH{};         ///< P H'
    UnalignedMatrix<N, N> root_information{};  ///< of the innovation
    double nis = 0;

    void form(const Matrix12& P) {
        PH = P * H.transpose();
        const UnalignedMatrix<N, N> covariance = H * PH + R;
        root_information = root_of_inverse(covariance);
        nis = (root_information * z).squaredNorm();
    }
};

Innovation<6> innovation_of(const MotionModel&, const RelativeState& state, const Matrix12& P,
                            const PoseMeasurement& m) {
    Innovation<6> i{.H = pose_jacobian(q_frame_sensor(m), state),
                    .z = error_between(expected_pose(state, m), m.T_sensor_target),
                    .R = m.covariance};
    if (m.root_information) {  // whitened: S is at least 1
        i.H = (*m.root_information * i.H).eval();
        i.z = (*m.root_information * i.z).eval();
        i.R.setIdentity();
    }
    i.form(P);
    return i;
}

Innovation<1> innovation_of(const MotionModel& motion, const RelativeState& state, const Matrix12& P,
                            const BeamVelocity& m) {
    const auto [velocity_m_s, H] = expected_velocity(state, motion.orbit_rate_rad_s, m);
    Innovation<1> i{.H = H, .z{}, .R{}};
    i.z(0) = m.velocity_m_s - velocity_m_s;
    i.R(0) = m.sigma_m_s * m.sigma_m_s;
    i.form(P);
    return i;
}

Innovation<1> innovation_of(const MotionModel&, const RelativeState& state, const Matrix12& P, const BeamRange& m) {
    const auto [range_m, H] = expected_range(state, m);
    Innovation<1> i{.H = H, .z{}, .R{}};
    i.z(0) = m.range_m - range_m;
    i.R(0) = m.sigma_m * m.sigma_m;
    i.form(P);
    return i;
}

/// A C A': the covariance of A e, given that of e.
Matrix12 carried(const Matrix12& A, const Matrix12& covariance) {
    return A * covariance * A.transpose();
}

/// `taken`: K H, the part of the state that the measurement replaces; `noise`: K R K', the measurement's own noise.
void correct(const Vector12& step, const Matrix12& taken, const Matrix12& noise, RelativeState& state,
             Matrix12& P) {
    state = displaced(state, step);
    P = carried(Matrix12::Identity() - taken, P) + noise;
    // Reset: errors now refer to the corrected attitude, to first order a rotation by half the step.
    Matrix12 reset = Matrix12::Identity();
    const Eigen::Vector3d a = 0.5 * step.segment<3>(6);
    reset.block<3, 3>(6, 6) << 1, a.z(), -a.y(), -a.z(), 1, a.x(), a.y(), -a.x(), 1;
    P = carried(reset, P);
    P = (0.5 * (P + P.transpose())).eval();
}

template <int N>
void correct(const Innovation<N>& i, RelativeState& state, Matrix12& P) {
    const Eigen::Matrix<double, 12, N> K = i.PH * (i.root_information.transpose() * i.root_information);
    correct(K * i.z, K * i.H, K * i.R * K.transpose(), state, P);
}

Status check(const FilterSettings& s) {
    if (auto good = check(s.motion); !good) return good.error();
    for (const auto& [name, gate] : {std::pair{"gate", s.gate}, std::pair{"beam_gate", s.beam_gate}})
        if (!(gate > 0)) return Error{std::string(name) + " = " + std::to_string(gate) + ": expected > 0"};
    if (s.history < 2) return Error{"history = " + std::to_string(s.history) + ": expected 2 events or more"};
    return Ok{};
}

}  // namespace

Result<PoseFilter> PoseFilter::create(const FilterSettings& settings, std::int64_t t_ns, const RelativeState& state,
                                      const Matrix12& covariance) {
    if (auto good = check(settings); !good) return good.error();
    if (!is_finite(state.position_m) || !is_finite(state.velocity_m_s) || !is_finite(state.rate_rad_s) ||
        !is_unit(state.q_frame_target))
        return Error{"the filter's first state: expected finite numbers and a unit quaternion"};
    if (!is_covariance(covariance))
        return Error{"the filter's first covariance: expected it finite, symmetric and positive definite"};
    PoseFilter filter(settings);
    filter.t_ns_ = t_ns;
    filter.now_ = {state, covariance};
    filter.history_.reserve(settings.history);
    filter.history_.push_back({t_ns, filter.now_, {}, {}});
    return filter;
}

Result<PoseFilter> PoseFilter::create(const FilterSettings& settings, const PoseMeasurement& first,
                                      double velocity_sigma_m_s, double rate_sigma_rad_s) {
    if (const char* why = fault(first)) return Error{std::string("the filter's first measurement: ") + why};
    if (!(velocity_sigma_m_s > 0) || !(rate_sigma_rad_s > 0))
        return Error{"the filter's first velocity and rate: expected standard deviations > 0"};
    const Rigid3 T_chaser_target = first.T_chaser_sensor * first.T_sensor_target;
    RelativeState state;
    state.q_frame_target = normalized(first.q_frame_chaser * T_chaser_target.q);
    state.position_m = first.q_frame_chaser * T_chaser_target.t;
    state.rate_rad_s = conjugate(state.q_frame_target) * Vec3{0, 0, settings.motion.orbit_rate_rad_s};

    Matrix12 P = Matrix12::Zero();
    const Matrix6x12 H = pose_jacobian(q_frame_sensor(first), state);
    P = H.transpose() * covariance_of(first) *
        H;  // H takes errors to errors by rotations: its transpose is its inverse
    for (int i = 0; i < 3; ++i) {
        P(3 + i, 3 + i) = velocity_sigma_m_s * velocity_sigma_m_s;
        P(9 + i, 9 + i) = rate_sigma_rad_s * rate_sigma_rad_s;
    }
    return create(settings, first.t_ns, state, 0.5 * (P + P.transpose()));
}

PoseFilter::Estimate PoseFilter::propagated(Estimate from, const Thrust& thrust, std::int64_t by_ns) const {
    MotionModel motion = settings_.motion;
    motion.acceleration_psd += thrust.psd;
    propagate(motion, 1e-9 * static_cast<double>(by_ns), thrust.acceleration_m_s2, from.state, from.covariance);
    return from;
}

/// Drops the oldest event if the history is full.
void PoseFilter::insert(std::size_t place, const Event& event) {
    if (history_.size() == settings_.history) {
        std::move(history_.begin() + 1, history_.begin() + static_cast<std::ptrdiff_t>(place), history_.begin());
        history_[place - 1] = event;
    } else {
        history_.insert(history_.begin() + static_cast<std::ptrdiff_t>(place), event);
    }
}

void PoseFilter::predict(std::int64_t t_ns) {
    if (t_ns <= t_ns_) return;
    now_ = propagated(now_, history_.back().thrust, t_ns - t_ns_);
    t_ns_ = t_ns;
}

/// Index of the first event later than t_ns.
std::size_t PoseFilter::first_after(std::int64_t t_ns) const {
    const auto later = std::upper_bound(history_.begin(), history_.end(), t_ns,
                                        [](std::int64_t t, const Event& e) { return t < e.t_ns; });
    return static_cast<std::size_t>(later - history_.begin());
}

/// Repeats the events from `place` on, after a change before them.
void PoseFilter::repeat_from(std::size_t place) {
    for (std::size_t i = place; i < history_.size(); ++i) {
        Event& e = history_[i];
        e.after = after(history_[i - 1], e.t_ns);
        const auto repeat = [&](const auto& measured) {
            if constexpr (!std::is_same_v<std::decay_t<decltype(measured)>, std::monostate>) {
                e.thrust = history_[i - 1].thrust;
                correct(innovation_of(settings_.motion, e.after.state, e.after.covariance, measured), e.after.state,
                        e.after.covariance);
            }
        };
        std::visit(repeat, e.measurement);
    }
    now_ = after(history_.back(), t_ns_);
}

bool PoseFilter::accelerate(std::int64_t t_ns, const Vec3& acceleration_m_s2, double psd) {
    if (!is_finite(acceleration_m_s2) || !(psd >= 0 && std::isfinite(psd)) || t_ns < history_.front().t_ns)
        return false;
    const Thrust thrust{acceleration_m_s2, psd};
    predict(t_ns);
    if (t_ns == t_ns_) {
        if (history_.back().thrust != thrust) insert(history_.size(), {t_ns_, now_, thrust, {}});
        return true;
    }
    const auto of_thrust = [&](const Event& e) {
        return e.t_ns > t_ns && std::holds_alternative<std::monostate>(e.measurement);
    };
    std::erase_if(history_, of_thrust);
    const std::size_t place = first_after(t_ns);
    const std::size_t dropped = history_.size() == settings_.history ? 1 : 0;
    insert(place, {t_ns, after(history_[place - 1], t_ns), thrust, {}});
    repeat_from(place - dropped + 1);
    return true;
}

template <class Measurement>
UpdateResult PoseFilter::take(const Measurement& m, double gate) {
    constexpr bool kPose = std::is_same_v<Measurement, PoseMeasurement>;
    if (const char* why = fault(m)) {
        ++counts_.bad;
        return {UpdateOutcome::bad, 0, why};
    }
    if (m.t_ns < history_.front().t_ns) {
        ++counts_.too_late;
        return {UpdateOutcome::too_late, 0, "it is older than what the filter remembers"};
    }
    const std::size_t place = first_after(m.t_ns);
    const Event& before = history_[place - 1];
    Event event{m.t_ns, after(before, m.t_ns), before.thrust, m};
    const auto innovation = innovation_of(settings_.motion, event.after.state, event.after.covariance, m);
    if (!(innovation.nis <= gate)) {
        ++counts_.gated;
        counts_.gated_in_a_row += kPose ? 1 : 0;
        predict(m.t_ns);
        return {UpdateOutcome::gated, innovation.nis, "it contradicts what the filter knows"};
    }
    correct(innovation, event.after.state, event.after.covariance);

    counts_.late += m.t_ns < t_ns_;
    ++counts_.taken;
    if (kPose) counts_.gated_in_a_row = 0;
    const std::size_t dropped = history_.size() == settings_.history ? 1 : 0;
    insert(place, event);
    t_ns_ = std::max(t_ns_, m.t_ns);
    repeat_from(place - dropped + 1);
    return {UpdateOutcome::taken, innovation.nis, ""};
}

UpdateResult PoseFilter::update(const PoseMeasurement& m) {
    return take(m, settings_.gate);
}

UpdateResult PoseFilter::update(const BeamVelocity& m) {
    return take(m, settings_.beam_gate);
}

UpdateResult PoseFilter::update(const BeamRange& m) {
    return take(m, settings_.beam_gate);
}

PoseFilter::Pose PoseFilter::pose(const Quat& q_frame_chaser) const {
    const Matrix6x12 J = pose_jacobian(q_frame_chaser, now_.state);
    return {
        {conjugate(q_frame_chaser) * now_.state.q_frame_target, conjugate(q_frame_chaser) * now_.state.position_m},
        J * now_.covariance * J.transpose()};
}

Status PoseTracker::start(std::int64_t t_ns, const RelativeState& state, const Matrix12& covariance) {
    auto made = PoseFilter::create(settings_.filter, t_ns, state, covariance);
    if (!made) return made.error();
    filter_ = *std::move(made);
    return Ok{};
}

UpdateResult PoseTracker::update(const PoseMeasurement& measurement) {
    UpdateResult result{
        UpdateOutcome::bad, 0,
        "it cannot start a filter: expected finite numbers, unit quaternions, a positive definite covariance"};
    if (filter_) {
        result = filter_->update(measurement);
        if (result.outcome == UpdateOutcome::taken) first_.reset();
        const bool contradicts_the_first = first_ && result.outcome == UpdateOutcome::gated;
        if (!contradicts_the_first &&
            (result.outcome != UpdateOutcome::gated || filter_->counts().gated_in_a_row < settings_.gated_in_a_row))
            return result;
    }
    const auto [velocity_m_s, rate_rad_s] = first_sigmas(measurement);
    auto made = PoseFilter::create(settings_.filter, measurement, velocity_m_s, rate_rad_s);
    if (!made) return result;
    restarts_ += filter_ ? 1 : 0;
    filter_ = *std::move(made);
    first_ = measurement;
    return {UpdateOutcome::taken, 0, ""};
}

/// Those of the settings, and at least the motion from the first measurement to this one, if the two contradict.
std::array<double, 2> PoseTracker::first_sigmas(const PoseMeasurement& measurement) const {
    std::array<double, 2> sigmas{settings_.first_velocity_m_s, settings_.first_rate_rad_s};
    if (!filter_ || !first_ || measurement.t_ns <= first_->t_ns) return sigmas;
    const double dt_s = 1e-9 * static_cast<double>(measurement.t_ns - first_->t_ns);
    const auto in_frame = [](const PoseMeasurement& m) {
        return Rigid3{m.q_frame_chaser, {}} * m.T_chaser_sensor * m.T_sensor_target;
    };
    const ApparentMotion motion = motion_between(in_frame(*first_), in_frame(measurement), dt_s);
    return {std::max(sigmas[0], norm(motion.velocity_m_s)), std::max(sigmas[1], norm(motion.rate_rad_s))};
}

UpdateResult PoseTracker::update(const BeamVelocity& measurement) {
    if (filter_) return filter_->update(measurement);
    return {UpdateOutcome::bad, 0, "a velocity cannot start a filter"};
}

UpdateResult PoseTracker::update(const BeamRange& measurement) {
    if (filter_) return filter_->update(measurement);
    return {UpdateOutcome::bad, 0, "a range cannot start a filter"};
}

}  // namespace narpa
