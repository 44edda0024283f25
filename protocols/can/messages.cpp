#include "protocols/can/messages.h"

#include <cmath>
#include <cstdio>

#include "protocols/can/signal_values.h"

namespace narpa {
namespace {

/// The 14 physical values in the order of kPoseSignals; the time is not among the doubles.
std::array<double, kPoseSignalCount> values_of(const Motion& m) noexcept {
    const Rigid3& T = m.T_world_body;
    return {0,
            T.t.x,
            T.t.y,
            T.t.z,
            T.q.w,
            T.q.x,
            T.q.y,
            T.q.z,
            m.velocity_m_s.x,
            m.velocity_m_s.y,
            m.velocity_m_s.z,
            m.rate_rad_s.x,
            m.rate_rad_s.y,
            m.rate_rad_s.z};
}

EncodeStatus quantise(const PoseCommand& command, BitPlace Signal::*form, RawSignals& raw) noexcept {
    const double norm_q = norm(command.motion.T_world_body.q);
    if (!(std::abs(norm_q - 1.0) <= kUnitTolerance))
        return {"AttitudeNorm", "", norm_q, 1.0 - kUnitTolerance, 1.0 + kUnitTolerance};
    const auto values = values_of(command.motion);
    raw[kPoseTime] = time_steps(command.t_valid_ns);
    for (std::size_t i = kPosePosition; i < kPoseSignalCount; ++i) {
        const Signal& signal = kPoseSignals[i];
        const auto limit = static_cast<double>(raw_max(true, (signal.*form).length));
        const double scaled = std::round(values[i] * signal.steps_per_unit);
        if (!(std::abs(scaled) <= limit))
            return {signal.name, signal.unit, values[i], -limit / signal.steps_per_unit,
                    limit / signal.steps_per_unit};
        raw[i] = static_cast<std::int64_t>(scaled);
    }
    return {};
}

DecodeStatus pose_verdict(const RawSignals& raw) noexcept {
    for (std::size_t i = 0; i < kPoseSignalCount; ++i)
        if (raw[i] == kNotAvailable) return DecodeStatus::not_a_number;
    return judge_attitude(attitude_of(raw, kPoseSignals, kPoseAttitude));
}

}  // namespace

std::string EncodeStatus::text() const {
    std::array<char, 160> text{};
    const char* space = unit.empty() ? "" : " ";
    std::snprintf(text.data(), text.size(), "%.*s = %.9g%s%.*s is outside %.9g .. %.9g%s%.*s",
                  static_cast<int>(quantity.size()), quantity.data(), value, space, static_cast<int>(unit.size()),
                  unit.data(), min, max, space, static_cast<int>(unit.size()), unit.data());
    return text.data();
}

EncodeStatus encode_classic(const PoseCommand& command, std::uint32_t base_id, FrameSet& out) noexcept {
    RawSignals raw{};
    const EncodeStatus status = quantise(command, &Signal::classic, raw);
    if (status) out = encode_classic(kPoseLayout, raw, command.counter, base_id);
    return status;
}

EncodeStatus encode_fd(const PoseCommand& command, std::uint32_t base_id, CanFrame& out) noexcept {
    RawSignals raw{};
    const EncodeStatus status = quantise(command, &Signal::fd, raw);
    if (status) out = encode_fd(kPoseLayout, raw, command.counter, base_id);
    return status;
}

EncodeStatus encode(const PoseCommand& command, std::uint32_t base_id, bool fd, FrameSet& out) noexcept {
    if (!fd) return encode_classic(command, base_id, out);
    CanFrame frame;
    const EncodeStatus status = encode_fd(command, base_id, frame);
    if (status) out = FrameSet(frame);
    return status;
}

PoseDecoder::PoseDecoder(std::uint32_t base_id) noexcept : set_(kPoseLayout, base_id, pose_verdict) {}

PoseStatus PoseDecoder::accept(const CanFrame& frame, std::int64_t t_reference_ns, PoseCommand& out) noexcept {
    const DecodeStatus status = set_.accept(frame);
    if (status != DecodeStatus::complete) return status;
    const RawSignals& raw = set_.raw();
    out.counter = set_.counter();
    out.t_valid_ns = unwrap_time(static_cast<std::uint64_t>(raw[kPoseTime]), kTimeBits, t_reference_ns);
    out.motion.T_world_body = {normalized(attitude_of(raw, kPoseSignals, kPoseAttitude)),
                               vector_of(raw, kPoseSignals, kPosePosition)};
    out.motion.velocity_m_s = vector_of(raw, kPoseSignals, kPoseVelocity);
    out.motion.rate_rad_s = vector_of(raw, kPoseSignals, kPoseRate);
    return status;
}

}  // namespace narpa
