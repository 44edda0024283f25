#include "protocols/can/closed_loop_signals.h"
#include "protocols/can/message_codec.h"

// Messages of a closed loop (messages.h).
namespace narpa {
namespace {

constexpr std::size_t kNoAttitude = kMaxSignals;

/// What the messages of a closed loop share. kAttitude: index of the quaternion's first signal.
template <const SetLayout& kLayout, std::uint32_t kBaseId, std::size_t kAttitude = kNoAttitude>
struct ClosedLoopCodec {
    static constexpr const SetLayout& layout = kLayout;
    static std::uint32_t base_id(std::uint8_t) noexcept { return kBaseId; }
    static std::uint8_t camera(const auto&) noexcept { return 0; }
    static std::uint8_t counter(const auto& m) noexcept { return m.counter; }

    /// Every quantity is there, every choice is a known one, every quaternion is a rotation.
    static DecodeStatus check(const RawSignals& raw) noexcept {
        const SignalTable signals = layout.signals;
        for (std::size_t i = 0; i < signals.size(); ++i)
            if (raw[i] == kNotAvailable) return DecodeStatus::not_a_number;
        if (!has_known_choices(raw, signals)) return DecodeStatus::not_a_number;
        if constexpr (kAttitude == kNoAttitude) return DecodeStatus::complete;
        return judge_attitude(attitude_of(raw, signals, kAttitude));
    }
};

}  // namespace

template <>
struct Codec<ActuatorCommand> : ClosedLoopCodec<kActuatorLayout, kActuatorBaseId> {
    static RawSignals raw_of(const ActuatorCommand& c) noexcept {
        RawSignals raw{};
        raw[kActuatorTime] = time_steps(c.t_ns);
        put(raw, kActuatorSignals, kActuatorImpulse, c.impulse_n_s);
        put(raw, kActuatorSignals, kActuatorAngularImpulse, c.angular_impulse_n_m_s);
        raw[kActuatorLeg] = c.leg;
        raw[kActuatorPhase] = static_cast<std::int64_t>(c.phase);
        raw[kActuatorAbort] = static_cast<std::int64_t>(c.abort);
        return raw;
    }
    static void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns,
                     ActuatorCommand& out) noexcept {
        out.counter = counter;
        out.t_ns = time_of(raw[kActuatorTime], t_reference_ns);
        out.impulse_n_s = vector_of(raw, kActuatorSignals, kActuatorImpulse);
        out.angular_impulse_n_m_s = vector_of(raw, kActuatorSignals, kActuatorAngularImpulse);
        out.leg = static_cast<std::uint8_t>(raw[kActuatorLeg]);
        out.phase = static_cast<GuidancePhase>(raw[kActuatorPhase]);
        out.abort = static_cast<AbortReason>(raw[kActuatorAbort]);
    }
};
NARPA_CAN_MESSAGE(ActuatorCommand);

template <>
struct Codec<NavigationEstimate> : ClosedLoopCodec<kNavigationLayout, kNavigationBaseId, kNavigationAttitude> {
    static std::uint8_t counter(const NavigationEstimate& e) noexcept { return static_cast<std::uint8_t>(e.cycle); }
    static RawSignals raw_of(const NavigationEstimate& e) noexcept {
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
    static void read(const RawSignals& raw, std::uint8_t, std::int64_t t_reference_ns,
                     NavigationEstimate& out) noexcept {
        out.t_ns = time_of(raw[kNavigationTime], t_reference_ns);
        out.T_chaser_target = {normalized(attitude_of(raw, kNavigationSignals, kNavigationAttitude)),
                               vector_of(raw, kNavigationSignals, kNavigationPosition)};
        out.sigma_position_m = vector_of(raw, kNavigationSignals, kNavigationSigmaPosition);
        out.sigma_rotation_rad = vector_of(raw, kNavigationSignals, kNavigationSigmaRotation);
        out.cycle = static_cast<std::uint32_t>(raw[kNavigationCycle]);
        out.frames = static_cast<std::uint8_t>(raw[kNavigationFrameCount]);
        out.sweeps = static_cast<std::uint8_t>(raw[kNavigationSweepCount]);
    }
};
NARPA_CAN_MESSAGE(NavigationEstimate);

template <>
struct Codec<AttitudeReport> : ClosedLoopCodec<kAttitudeLayout, kAttitudeBaseId, kAttitudeQuaternion> {
    static RawSignals raw_of(const AttitudeReport& r) noexcept {
        RawSignals raw{};
        raw[kAttitudeTime] = time_steps(r.t_ns);
        put(raw, kAttitudeSignals, kAttitudeQuaternion, r.q_world_chaser);
        put(raw, kAttitudeSignals, kAttitudeRate, r.rate_rad_s);
        return raw;
    }
    static void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns,
                     AttitudeReport& out) noexcept {
        out.counter = counter;
        out.t_ns = time_of(raw[kAttitudeTime], t_reference_ns);
        out.q_world_chaser = normalized(attitude_of(raw, kAttitudeSignals, kAttitudeQuaternion));
        out.rate_rad_s = vector_of(raw, kAttitudeSignals, kAttitudeRate);
    }
};
NARPA_CAN_MESSAGE(AttitudeReport);

template <>
struct Codec<DynamicsReport> : ClosedLoopCodec<kDynamicsLayout, kDynamicsBaseId> {
    static RawSignals raw_of(const DynamicsReport& r) noexcept {
        RawSignals raw{};
        raw[kDynamicsTime] = time_steps(r.t_ns);
        raw[kDynamicsStart] = time_steps(r.t_start_ns);
        raw[kDynamicsPhase] = static_cast<std::int64_t>(r.phase);
        return raw;
    }
    static void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns,
                     DynamicsReport& out) noexcept {
        out.counter = counter;
        out.t_ns = time_of(raw[kDynamicsTime], t_reference_ns);
        out.t_start_ns = time_of(raw[kDynamicsStart], t_reference_ns);
        out.phase = static_cast<DynamicsPhase>(raw[kDynamicsPhase]);
    }
};
NARPA_CAN_MESSAGE(DynamicsReport);

}  // namespace narpa
