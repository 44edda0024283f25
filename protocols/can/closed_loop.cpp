#include "protocols/can/closed_loop.h"

#include <utility>

#include "protocols/can/signal_values.h"

namespace narpa {
namespace {

/// What makes one kind of message a set.
struct Wire {
    const SetLayout& layout;
    std::uint32_t base_id;
    std::size_t attitude;  ///< index of the quaternion's first signal; no signal has it: none
};
constexpr std::size_t kNoAttitude = kMaxSignals;

constexpr Wire wire(const ActuatorCommand&) noexcept {
    return {kActuatorLayout, kActuatorBaseId, kNoAttitude};
}
constexpr Wire wire(const NavigationEstimate&) noexcept {
    return {kNavigationLayout, kNavigationBaseId, kNavigationAttitude};
}
constexpr Wire wire(const AttitudeReport&) noexcept {
    return {kAttitudeLayout, kAttitudeBaseId, kAttitudeQuaternion};
}
constexpr Wire wire(const DynamicsReport&) noexcept {
    return {kDynamicsLayout, kDynamicsBaseId, kNoAttitude};
}

// --- To the wire ------------------------------------------------------------------------------------------------

std::uint8_t counter_of(const NavigationEstimate& e) noexcept {
    return static_cast<std::uint8_t>(e.cycle);
}
template <class Message>
std::uint8_t counter_of(const Message& m) noexcept {
    return m.counter;
}

RawSignals raw_of(const ActuatorCommand& c) noexcept {
    RawSignals raw{};
    raw[kActuatorTime] = time_steps(c.t_ns);
    put(raw, kActuatorSignals, kActuatorImpulse, c.impulse_n_s);
    put(raw, kActuatorSignals, kActuatorAngularImpulse, c.angular_impulse_n_m_s);
    raw[kActuatorLeg] = c.leg;
    raw[kActuatorPhase] = static_cast<std::int64_t>(c.phase);
    raw[kActuatorAbort] = static_cast<std::int64_t>(c.abort);
    return raw;
}

RawSignals raw_of(const NavigationEstimate& e) noexcept {
    RawSignals raw{};
    raw[kNavigationTime] = time_steps(e.t_ns);
    put(raw, kNavigationSignals, kNavigationPosition, e.T_chaser_target.t);
    put(raw, kNavigationSignals, kNavigationAttitude, e.T_chaser_target.q);
    put(raw, kNavigationSignals, kNavigationSigmaPosition, e.sigma_position_m);
    put(raw, kNavigationSignals, kNavigationSigmaRotation, e.sigma_rotation_rad);
    raw[kNavigationCycle] = e.cycle;
    raw[kNavigationFrameCount] = e.frames;
    raw[kNavigationSweepCount] = e.sweeps;
    return raw;
}

RawSignals raw_of(const AttitudeReport& r) noexcept {
    RawSignals raw{};
    raw[kAttitudeTime] = time_steps(r.t_ns);
    put(raw, kAttitudeSignals, kAttitudeQuaternion, r.q_world_chaser);
    put(raw, kAttitudeSignals, kAttitudeRate, r.rate_rad_s);
    return raw;
}

RawSignals raw_of(const DynamicsReport& r) noexcept {
    RawSignals raw{};
    raw[kDynamicsTime] = time_steps(r.t_ns);
    raw[kDynamicsStart] = time_steps(r.t_start_ns);
    raw[kDynamicsPhase] = static_cast<std::int64_t>(r.phase);
    return raw;
}

template <class Frames, class Message>
Frames classic(const Message& m) noexcept {
    const RawSignals raw = raw_of(m);
    Frames out;
    for (std::size_t i = 0; i < out.size(); ++i)
        out[i] = encode_classic(wire(m).layout, raw, counter_of(m), wire(m).base_id, i);
    return out;
}

template <class Message>
CanFrame fd(const Message& m) noexcept {
    return encode_fd(wire(m).layout, raw_of(m), counter_of(m), wire(m).base_id);
}

// --- From the wire ----------------------------------------------------------------------------------------------

std::int64_t time_of(std::int64_t raw, std::int64_t t_reference_ns) noexcept {
    return unwrap_time(static_cast<std::uint64_t>(raw), kTimeBits, t_reference_ns);
}

void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns, ActuatorCommand& out) noexcept {
    out.counter = counter;
    out.t_ns = time_of(raw[kActuatorTime], t_reference_ns);
    out.impulse_n_s = vector_of(raw, kActuatorSignals, kActuatorImpulse);
    out.angular_impulse_n_m_s = vector_of(raw, kActuatorSignals, kActuatorAngularImpulse);
    out.leg = static_cast<std::uint8_t>(raw[kActuatorLeg]);
    out.phase = static_cast<GuidancePhase>(raw[kActuatorPhase]);
    out.abort = static_cast<AbortReason>(raw[kActuatorAbort]);
}

void read(const RawSignals& raw, std::uint8_t, std::int64_t t_reference_ns, NavigationEstimate& out) noexcept {
    out.t_ns = time_of(raw[kNavigationTime], t_reference_ns);
    out.T_chaser_target = {normalized(attitude_of(raw, kNavigationSignals, kNavigationAttitude)),
                           vector_of(raw, kNavigationSignals, kNavigationPosition)};
    out.sigma_position_m = vector_of(raw, kNavigationSignals, kNavigationSigmaPosition);
    out.sigma_rotation_rad = vector_of(raw, kNavigationSignals, kNavigationSigmaRotation);
    out.cycle = static_cast<std::uint32_t>(raw[kNavigationCycle]);
    out.frames = static_cast<std::uint8_t>(raw[kNavigationFrameCount]);
    out.sweeps = static_cast<std::uint8_t>(raw[kNavigationSweepCount]);
}

void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns, AttitudeReport& out) noexcept {
    out.counter = counter;
    out.t_ns = time_of(raw[kAttitudeTime], t_reference_ns);
    out.q_world_chaser = normalized(attitude_of(raw, kAttitudeSignals, kAttitudeQuaternion));
    out.rate_rad_s = vector_of(raw, kAttitudeSignals, kAttitudeRate);
}

void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns, DynamicsReport& out) noexcept {
    out.counter = counter;
    out.t_ns = time_of(raw[kDynamicsTime], t_reference_ns);
    out.t_start_ns = time_of(raw[kDynamicsStart], t_reference_ns);
    out.phase = static_cast<DynamicsPhase>(raw[kDynamicsPhase]);
}

/// Every quantity is there, every choice is a known one, every quaternion is a rotation.
template <class Message>
DecodeStatus verdict(const RawSignals& raw) noexcept {
    const Wire w = wire(Message{});
    const SignalTable signals = w.layout.signals;
    for (std::size_t i = 0; i < signals.size(); ++i) {
        const bool known = signals[i].choices.empty() || std::cmp_less(raw[i], signals[i].choices.size());
        if (raw[i] == kNotAvailable || !known) return DecodeStatus::not_a_number;
    }
    if (w.attitude == kNoAttitude) return DecodeStatus::complete;
    return judge_attitude(attitude_of(raw, signals, w.attitude));
}

}  // namespace

ActuatorFrames encode_classic(const ActuatorCommand& command) noexcept {
    return classic<ActuatorFrames>(command);
}
CanFrame encode_fd(const ActuatorCommand& command) noexcept {
    return fd(command);
}
NavigationFrames encode_classic(const NavigationEstimate& estimate) noexcept {
    return classic<NavigationFrames>(estimate);
}
CanFrame encode_fd(const NavigationEstimate& estimate) noexcept {
    return fd(estimate);
}
AttitudeFrames encode_classic(const AttitudeReport& report) noexcept {
    return classic<AttitudeFrames>(report);
}
CanFrame encode_fd(const AttitudeReport& report) noexcept {
    return fd(report);
}
DynamicsFrames encode_classic(const DynamicsReport& report) noexcept {
    return classic<DynamicsFrames>(report);
}
CanFrame encode_fd(const DynamicsReport& report) noexcept {
    return fd(report);
}

template <class Message>
MessageDecoder<Message>::MessageDecoder() noexcept
    : set_(wire(Message{}).layout, wire(Message{}).base_id, verdict<Message>) {}

template <class Message>
DecodeStatus MessageDecoder<Message>::accept(const CanFrame& frame, std::int64_t t_reference_ns,
                                             Message& out) noexcept {
    const DecodeStatus status = set_.accept(frame);
    if (status == DecodeStatus::complete) read(set_.raw(), set_.counter(), t_reference_ns, out);
    return status;
}

template class MessageDecoder<ActuatorCommand>;
template class MessageDecoder<NavigationEstimate>;
template class MessageDecoder<AttitudeReport>;
template class MessageDecoder<DynamicsReport>;

}  // namespace narpa
