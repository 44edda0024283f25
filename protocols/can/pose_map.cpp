#include "protocols/can/pose_map.h"

#include <algorithm>
#include <cmath>

#include "base/constants.h"

namespace narpa {
namespace {

struct PoseUnit {
    PoseQuantity quantity;
    std::string_view name;
    double to_si;
};
constexpr double kDegree_rad = kPi / 180;
constexpr auto kPoseUnits = std::to_array<PoseUnit>({
    {PoseQuantity::position, "m", 1},
    {PoseQuantity::position, "km", 1e3},
    {PoseQuantity::position, "cm", 1e-2},
    {PoseQuantity::position, "mm", 1e-3},
    {PoseQuantity::attitude, "1", 1},
    {PoseQuantity::velocity, "m/s", 1},
    {PoseQuantity::velocity, "km/s", 1e3},
    {PoseQuantity::velocity, "cm/s", 1e-2},
    {PoseQuantity::velocity, "mm/s", 1e-3},
    {PoseQuantity::rate, "rad/s", 1},
    {PoseQuantity::rate, "deg/s", kDegree_rad},
    {PoseQuantity::rate, "mrad/s", 1e-3},
    {PoseQuantity::time, "s", 1},
    {PoseQuantity::time, "ms", 1e-3},
    {PoseQuantity::time, "us", 1e-6},
    {PoseQuantity::time, "ns", 1e-9},
});

}  // namespace

std::optional<double> si_factor(PoseQuantity quantity, std::string_view unit) {
    if (unit.empty()) return 1;
    for (const PoseUnit& u : kPoseUnits)
        if (u.quantity == quantity && u.name == unit) return u.to_si;
    return std::nullopt;
}

std::string units_of(PoseQuantity quantity) {
    std::string text;
    for (const PoseUnit& u : kPoseUnits)
        if (u.quantity == quantity) text.append(text.empty() ? "" : ", ").append(u.name);
    return text;
}

MappedPoseDecoder::MappedPoseDecoder(std::shared_ptr<const PoseMap> map)
    : map_(std::move(map)), parts_(map_->messages.size()) {}

PoseStatus MappedPoseDecoder::accept(const CanFrame& frame, std::int64_t t_now_ns, PoseCommand& out) noexcept {
    const PoseStatus status = take(frame, t_now_ns, out);
    ++counts_[static_cast<std::size_t>(status)];
    return status;
}

PoseStatus MappedPoseDecoder::take(const CanFrame& frame, std::int64_t t_now_ns, PoseCommand& out) noexcept {
    if (frame.error) return PoseStatus::not_mine;
    const auto message = std::ranges::find_if(
        map_->messages, [&](const DbcMessage& m) { return m.id == frame.id && m.extended == frame.extended; });
    if (message == map_->messages.end()) return PoseStatus::not_mine;
    if (frame.remote) return PoseStatus::wrong_kind;
    if (frame.size < message->size) return PoseStatus::too_short;
    Part& part = parts_[static_cast<std::size_t>(message - map_->messages.begin())];
    if (part.come) ++counts_[static_cast<std::size_t>(PoseStatus::incomplete_set)];
    part.data = frame.data, part.come = true;
    if (!std::ranges::all_of(parts_, &Part::come)) return PoseStatus::partial;
    for (Part& p : parts_) p.come = false;
    const PoseStatus status = decode(t_now_ns, out);
    if (status == PoseStatus::complete) out.counter = counter_++;
    return status;
}

PoseStatus MappedPoseDecoder::decode(std::int64_t t_now_ns, PoseCommand& out) const noexcept {
    const PoseMap& m = *map_;
    const auto& a = m.attitude_wxyz;
    Motion motion;
    motion.T_world_body.t = vector(m.position);
    Quat q{number(a[0]), number(a[1]), number(a[2]), number(a[3])};
    if (m.velocity) motion.velocity_m_s = vector(*m.velocity);
    if (m.rate) motion.rate_rad_s = vector(*m.rate);
    const double sum = norm(motion.T_world_body.t) + norm(motion.velocity_m_s) + norm(motion.rate_rad_s) + norm(q);
    const double time_s = m.time ? number(*m.time) : 0;
    constexpr double kMost_s = 9e9;  // nanoseconds have 64 bits
    if (!std::isfinite(sum) || !(std::abs(time_s) < kMost_s)) return PoseStatus::not_a_number;
    if (!(std::abs(norm(q) - 1) <= kUnitTolerance)) return PoseStatus::not_unit;
    q = normalized(q);
    motion.T_world_body.q = m.world_to_body ? conjugate(q) : q;
    out.t_valid_ns = time_ns(t_now_ns);
    out.motion = motion;
    return PoseStatus::complete;
}

std::int64_t MappedPoseDecoder::time_ns(std::int64_t t_now_ns) const noexcept {
    if (!map_->time) return t_now_ns;
    const MappedNumber& t = *map_->time;
    const double s = number(t);
    const auto stated_ns = static_cast<std::int64_t>(std::llround(s * 1e9));
    if (t.signal.kind != DbcSignal::Kind::integer) return stated_ns;
    const double period_s = std::ldexp(std::abs(t.signal.factor) * t.to_si, t.signal.length);
    constexpr double kNeverWraps_s = 4e9;
    if (!(period_s < kNeverWraps_s)) return stated_ns;
    const double turns = std::round((1e-9 * static_cast<double>(t_now_ns) - s) / period_s);
    return stated_ns + static_cast<std::int64_t>(std::llround(turns * period_s * 1e9));
}

}  // namespace narpa
