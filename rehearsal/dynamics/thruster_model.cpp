#include "rehearsal/dynamics/thruster_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace narpa::rehearsal {
namespace {

constexpr int kForceGroups = 6;

}  // namespace

ThrusterModel::ThrusterModel(const Scenario& scenario, std::uint64_t seed)
    : thrusters_(scenario.thrusters),
      engine_(scenario.engine),
      period_ns_(scenario.period_ns()),
      faults_(scenario.faults),
      gains_(engine(seed, Stream::pulses)) {
    std::mt19937_64 draws = engine(seed, Stream::misalignment);
    for (int group = 0; group < kThrusterGroups; ++group) {
        Vec3 axis;
        axis[group % kForceGroups / 2] = group % 2 == 0 ? 1 : -1;
        directions_[group] =
            exp_rotation((thrusters_.misalignment_sigma_deg * kDegree) * draw_normal(draws)) * axis;
    }
}

void ThrusterModel::fire(const ActuatorCommand& command, std::int64_t t_ns) {
    pulses_ = {};
    for (int axis = 0; axis < 3; ++axis) {
        const double impulse = command.impulse_n_s[axis];
        const int group = 2 * axis + (impulse < 0);
        if (engine_ && group == static_cast<int>(engine_->group))
            burn(std::abs(impulse), t_ns);
        else
            fire(group, std::abs(impulse), t_ns);
    }
    for (int axis = 0; axis < 3; ++axis) {
        const double impulse = command.angular_impulse_n_m_s[axis];
        fire(kForceGroups + 2 * axis + (impulse < 0), std::abs(impulse), t_ns);
    }
}

void ThrusterModel::fire(int group, double impulse, std::int64_t t_ns) {
    const double wanted_s = impulse / full(group);
    if (!(wanted_s >= thrusters_.min_on_s) || wanted_s == 0) return;
    const std::int64_t on_ns = std::min(std::max<std::int64_t>(std::llround(wanted_s * 1e9), 1), period_ns_);
    // A pulse ends at a whole nanosecond: its force compensates the rounding of its duration.
    const double even_out = on_ns == period_ns_ ? 1 : wanted_s / (static_cast<double>(on_ns) * 1e-9);
    const double gain = 1 + thrusters_.gain_sigma * std::normal_distribution<double>()(gains_);
    pulses_[group] = {t_ns, t_ns + on_ns, full(group) * even_out * std::max(gain, 0.0)};
}

void ThrusterModel::burn(double impulse, std::int64_t t_ns) {
    if (!(impulse > 0)) return;
    const double force_n =
        std::clamp(1e9 * impulse / static_cast<double>(period_ns_), engine_->least_n, engine_->most_n);
    const double gain = 1 + engine_->gain_sigma * std::normal_distribution<double>()(gains_);
    pulses_[engine_->group] = {t_ns, t_ns + period_ns_, force_n * std::max(gain, 0.0)};
}

double ThrusterModel::full(int group) const noexcept {
    if (engine_ && group == static_cast<int>(engine_->group)) return engine_->most_n;
    return group < kForceGroups ? thrusters_.force_n : thrusters_.torque_n_m;
}

Loads ThrusterModel::loads(std::int64_t t_ns) const {
    const FaultEffects faults = effects_at(faults_, t_ns);
    Loads sum;
    for (int group = 0; group < kThrusterGroups; ++group)
        (group < kForceGroups ? sum.force_n : sum.torque_n_m) += strength(group, t_ns, faults) * directions_[group];
    return sum;
}

double ThrusterModel::strength(int group, std::int64_t t_ns, const FaultEffects& faults) const {
    const auto i = static_cast<std::size_t>(group);
    if (faults.off[i]) return 0;
    if (faults.stuck[i]) return full(group);
    const Pulse& p = pulses_[i];
    if (engine_ && i == engine_->group && faults.throttle_stuck) return p.strength > 0 ? engine_->least_n : 0;
    return t_ns >= p.from_ns && t_ns < p.until_ns ? p.strength : 0;
}

std::int64_t ThrusterModel::next_change_ns(std::int64_t t_ns) const {
    std::int64_t next = rehearsal::next_change_ns(faults_, t_ns);
    for (const Pulse& p : pulses_)
        if (p.until_ns > t_ns) next = std::min(next, p.until_ns);
    return next;
}

}  // namespace narpa::rehearsal
