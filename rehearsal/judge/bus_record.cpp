#include "rehearsal/judge/bus_record.h"

#include <algorithm>
#include <cmath>

namespace narpa::rehearsal {

bool MotionTrack::push(std::int64_t t_ns, const Motion& motion) {
    if (!samples_.empty() && t_ns <= samples_.back().t_ns) return false;
    samples_.push_back({t_ns, motion});
    return true;
}

std::optional<Motion> MotionTrack::at(std::int64_t t_ns) const {
    const auto after = std::lower_bound(samples_.begin(), samples_.end(), t_ns,
                                        [](const Sample& s, std::int64_t t) { return s.t_ns < t; });
    if (after == samples_.end()) return std::nullopt;
    if (after->t_ns == t_ns) return after->motion;
    if (after == samples_.begin()) return std::nullopt;
    const auto& [ta, a] = *std::prev(after);
    const auto& [tb, b] = *after;
    const double h = static_cast<double>(tb - ta) * 1e-9, u = static_cast<double>(t_ns - ta) * 1e-9 / h;
    const Vec3 pa = a.T_world_body.t, pb = b.T_world_body.t, va = a.velocity_m_s, vb = b.velocity_m_s;
    // Hermite interpolation: the terms added to the straight line vanish at both ends.
    const Vec3 line = (pb - pa) / h, bend_a = va - line, bend_b = vb - line;
    Motion m;
    m.T_world_body.t = pa + (pb - pa) * u + (bend_a * ((1 - u) * (1 - u) * u) + bend_b * ((u - 1) * u * u)) * h;
    m.velocity_m_s = line + bend_a * ((1 - u) * (1 - 3 * u)) + bend_b * (u * (3 * u - 2));
    m.T_world_body.q = slerp(a.T_world_body.q, b.T_world_body.q, u);
    m.rate_rad_s = a.rate_rad_s + (b.rate_rad_s - a.rate_rad_s) * u;
    return m;
}

namespace {

/// Position of the chaser's port origin, target's port axes.
Vec3 port_position_m(const Scenario& scenario, const Rigid3& T_chaser_target) {
    return (inverse(T_chaser_target * scenario.target.T_body_port) * scenario.chaser.T_body_port).t;
}

}  // namespace

double JudgedEstimate::largest_in_sigmas() const {
    double largest = 0;
    for (int i = 0; i < 3; ++i)
        largest = std::max({largest, std::abs(position_error_m[i]) / sigma_position_m[i],
                            std::abs(rotation_error_rad[i]) / sigma_rotation_rad[i]});
    return largest;
}

double JudgedEstimate::nees() const {
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
        const double p = position_error_m[i] / sigma_position_m[i];
        const double r = rotation_error_rad[i] / sigma_rotation_rad[i];
        sum += p * p + r * r;
    }
    return sum;
}

BusRecord::BusRecord(const Scenario& scenario)
    : scenario_(scenario), target_decoder_(scenario.target.can_id), chaser_decoder_(scenario.chaser.can_id) {
    for (std::uint8_t camera = 0; camera < kMaxTelemetryCameras; ++camera) ledger_decoders_.emplace_back(camera);
}

BusRecord::Update BusRecord::accept(const CanFrame& frame, std::int64_t t_reference_ns) {
    Update update;
    if (take_pose(frame, t_reference_ns, target_decoder_, target_)) {
        update.truth = compare_with_truth();
    } else if (take_pose(frame, t_reference_ns, chaser_decoder_, chaser_)) {
        t_pose_ns = chaser_.newest_ns();
        chaser_times_.push_back(t_pose_ns);
        update.truth = compare_with_truth();
    } else if (DynamicsReport report; count(report_decoder_.accept(frame, t_reference_ns, report))) {
        reports.push_back(report);
        update.report = true;
    } else if (ActuatorCommand command; count(command_decoder_.accept(frame, t_reference_ns, command))) {
        if (!commands.empty() && command.t_ns <= commands.back().t_ns) return ++late, update;
        commands.push_back(command);
        update.command = true;
    } else if (NavigationEstimate estimate; count(estimate_decoder_.accept(frame, t_reference_ns, estimate))) {
        if (estimate.t_ns <= t_estimate_ns_) return ++late, update;
        t_estimate_ns_ = estimate.t_ns;
        waiting_.push_back(estimate);
    } else if (Heartbeat beat; decode(frame, t_reference_ns, beat) == DecodeStatus::complete) {
        t_heartbeat_ns = std::max(t_heartbeat_ns, beat.t_ns);
        ++heartbeats.received;
        heartbeats.lockstep |= beat.state == RunState::lockstep;
    } else if (const auto camera = ledger_camera(frame.id)) {
        FrameLedger ledger;
        if (count(ledger_decoders_[*camera].accept(frame, t_reference_ns, ledger))) ledgers.push_back(ledger);
    }
    update.estimates = judge_waiting();
    return update;
}

bool BusRecord::take_pose(const CanFrame& frame, std::int64_t t_reference_ns, PoseDecoder& decoder,
                          MotionTrack& track) {
    PoseCommand command;
    if (!count(decoder.accept(frame, t_reference_ns, command))) return false;
    if (track.push(command.t_valid_ns, command.motion)) return true;
    ++late;
    return false;
}

/// True for a complete message; counts frames that cannot be decoded.
bool BusRecord::count(DecodeStatus status) {
    refused += status != DecodeStatus::not_mine && status != DecodeStatus::partial &&
               status != DecodeStatus::complete && status != DecodeStatus::duplicate;
    return status == DecodeStatus::complete;
}

std::optional<TruthState> BusRecord::truth_at(std::int64_t t_ns) const {
    const auto target = target_.at(t_ns), chaser = chaser_.at(t_ns);
    if (!target || !chaser) return std::nullopt;
    return TruthState{port_state(scenario_.target, *target, scenario_.chaser, *chaser), t_ns};
}

/// Computes the truth at the chaser's times for which the target's pose is known; none before the target's first
/// command.
std::size_t BusRecord::compare_with_truth() {
    std::size_t n = 0;
    while (!target_.empty() && !chaser_times_.empty() && chaser_times_.front() <= target_.newest_ns()) {
        if (const auto state = truth_at(chaser_times_.front())) {
            truth.push_back(*state);
            ++n;
        }
        chaser_times_.pop_front();
    }
    return n;
}

std::size_t BusRecord::judge_waiting() {
    std::size_t n = 0;
    while (!waiting_.empty() && !target_.empty() && !chaser_.empty() &&
           waiting_.front().t_ns <= std::min(target_.newest_ns(), chaser_.newest_ns())) {
        const NavigationEstimate e = waiting_.front();
        waiting_.pop_front();
        const auto target = target_.at(e.t_ns), chaser = chaser_.at(e.t_ns);
        if (!target || !chaser) continue;  // before the first command
        const Rigid3 truth_pose = inverse(chaser->T_world_body) * target->T_world_body;
        JudgedEstimate j;
        j.t_ns = e.t_ns;
        j.position_error_m = e.T_chaser_target.t - truth_pose.t;
        j.rotation_error_rad = rotation_vector(e.T_chaser_target.q * conjugate(truth_pose.q));
        j.sigma_position_m = e.sigma_position_m;
        j.sigma_rotation_rad = e.sigma_rotation_rad;
        j.port_position_m = port_position_m(scenario_, e.T_chaser_target);
        j.frames = e.frames;
        j.sweeps = e.sweeps;
        estimates.push_back(j);
        ++n;
    }
    return n;
}

std::int64_t BusRecord::t_start_ns() const {
    if (!reports.empty()) return reports.front().t_start_ns;
    return truth.empty() ? 0 : truth.front().t_ns;
}

const ActuatorCommand* BusRecord::command_before(std::int64_t t_ns) const {
    const auto after = std::lower_bound(commands.begin(), commands.end(), t_ns,
                                        [](const ActuatorCommand& c, std::int64_t t) { return c.t_ns < t; });
    return after == commands.begin() ? nullptr : &*std::prev(after);
}

const DynamicsReport* BusRecord::first_report(DynamicsPhase phase) const {
    const auto at =
        std::find_if(reports.begin(), reports.end(), [&](const DynamicsReport& r) { return r.phase == phase; });
    return at == reports.end() ? nullptr : &*at;
}

}  // namespace narpa::rehearsal
