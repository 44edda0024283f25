#include "protocols/can/messages.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

namespace narpa {
namespace {

using SignalTable = std::span<const Signal>;

constexpr int kTimeBits = 48, kHeartbeatTimeBits = 40;  // of nanoseconds, of microseconds
constexpr double kUnitTolerance = 1e-3;                 // of a quaternion's norm

constexpr std::size_t index_of(SignalTable signals, std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(signals, name, &Signal::name) - signals.begin());
}

/// The low bits of a time, which are sent.
std::int64_t time_steps(std::int64_t t_ns) noexcept {
    return t_ns & raw_max(false, kTimeBits);
}
std::int64_t time_of(std::int64_t raw, std::int64_t t_reference_ns) noexcept {
    return unwrap_time(static_cast<std::uint64_t>(raw), kTimeBits, t_reference_ns);
}
/// Rounds to the nearest microsecond, halves upwards; exact for negative times.
std::int64_t to_us(std::int64_t t_ns) noexcept {
    const std::int64_t q = t_ns / 1000, r = t_ns % 1000;
    return q + (r >= 500 ? 1 : r < -500 ? -1 : 0);
}

/// Values to raw signals, one after the other: a Vec3 takes three signals, a Quat four (w, x, y, z), a Rigid3
/// seven.
struct RawWriter {
    SignalTable signals;
    RawSignals raw{};
    std::size_t i = 0;

    /// Scales a value to the signal's steps and clamps it to the signal's range. A value that is not finite becomes
    /// "not available", in unsigned signals the maximum.
    void put(double value) noexcept {
        const Signal& s = signals[i];
        const std::int64_t limit = raw_max(s.is_signed, s.classic.length);
        const double most = static_cast<double>(limit), scaled = std::round(value * s.steps_per_unit);
        raw[i++] = std::isfinite(value)
                       ? static_cast<std::int64_t>(std::clamp(scaled, s.is_signed ? -most : 0.0, most))
                   : s.is_signed ? kNotAvailable
                                 : limit;
    }
    void put(std::int64_t t_ns) noexcept { raw[i++] = time_steps(t_ns); }
    void put(const Vec3& v) noexcept { put(v.x), put(v.y), put(v.z); }
    void put(const Quat& q) noexcept { put(q.w), put(q.vec()); }
    void put(const Rigid3& T) noexcept { put(T.t), put(T.q); }
    template <class Whole>
    void put(Whole value) noexcept {
        raw[i++] = static_cast<std::int64_t>(value);
    }
};

/// Raw signals to values.
struct RawReader {
    SignalTable signals;
    const RawSignals& raw;
    std::int64_t t_reference_ns = 0;
    std::size_t i = 0;

    double number() noexcept {
        const double steps = static_cast<double>(raw[i]);
        return steps / signals[i++].steps_per_unit;
    }
    /// As received: not normalised.
    Quat attitude() noexcept {
        Quat q;
        q.w = number(), q.x = number(), q.y = number(), q.z = number();
        return q;
    }
    void get(std::int64_t& t_ns) noexcept { t_ns = time_of(raw[i++], t_reference_ns); }
    /// NaN where it is not available.
    void get(double& value) noexcept {
        const bool known = raw[i] != kNotAvailable;
        value = number();
        if (!known) value = std::numeric_limits<double>::quiet_NaN();
    }
    void get(Vec3& v) noexcept { v.x = number(), v.y = number(), v.z = number(); }
    void get(Quat& q) noexcept { q = normalized(attitude()); }
    void get(Rigid3& T) noexcept { get(T.t), get(T.q); }
    void get(Motion& m) noexcept { get(m.T_world_body), get(m.velocity_m_s), get(m.rate_rad_s); }
    template <class Whole>
    void get(Whole& value) noexcept {
        value = static_cast<Whole>(raw[i++]);
    }
};

/// Every choice is a known one.
bool has_known_choices(const RawSignals& raw, SignalTable signals) noexcept {
    for (std::size_t i = 0; i < signals.size(); ++i)
        if (!signals[i].choices.empty() && raw[i] >= static_cast<std::int64_t>(signals[i].choices.size()))
            return false;
    return true;
}

/// Refuses missing quantities, unknown choices, and quaternions that are no rotation.
template <const SetLayout& kLayout>
DecodeStatus check(const RawSignals& raw) noexcept {
    constexpr SignalTable signals = kLayout.signals;
    for (std::size_t i = 0; i < signals.size(); ++i)
        if (raw[i] == kNotAvailable) return DecodeStatus::not_a_number;
    if (!has_known_choices(raw, signals)) return DecodeStatus::not_a_number;
    constexpr std::size_t kAttitude = index_of(signals, "AttitudeW");
    if constexpr (kAttitude < signals.size()) {
        const Quat q = RawReader{signals, raw, 0, kAttitude}.attitude();
        if (!(std::abs(norm(q) - 1.0) <= kUnitTolerance)) return DecodeStatus::not_unit;
    }
    return DecodeStatus::complete;
}

// --- Pose command -----------------------------------------------------------------------------------------------

EncodeStatus quantise(const PoseCommand& command, BitField Signal::*form, RawSignals& raw) noexcept {
    const auto& [T, v, w] = command.motion;
    if (!(std::abs(norm(T.q) - 1.0) <= kUnitTolerance))
        return {"AttitudeNorm", "", norm(T.q), 1.0 - kUnitTolerance, 1.0 + kUnitTolerance};
    raw[0] = time_steps(command.t_valid_ns);
    std::size_t i = 0;
    for (const double value : {T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z, v.x, v.y, v.z, w.x, w.y, w.z}) {
        const Signal& signal = kPoseSignals[++i];
        const auto limit = static_cast<double>(raw_max(true, (signal.*form).length));
        const double scaled = std::round(value * signal.steps_per_unit);
        if (!(std::abs(scaled) <= limit))
            return {signal.name, signal.unit, value, -limit / signal.steps_per_unit, limit / signal.steps_per_unit};
        raw[i] = static_cast<std::int64_t>(scaled);
    }
    return {};
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

PoseDecoder::PoseDecoder(std::uint32_t base_id) noexcept : set_(kPoseLayout, base_id, check<kPoseLayout>) {}

PoseStatus PoseDecoder::accept(const CanFrame& frame, std::int64_t t_reference_ns, PoseCommand& out) noexcept {
    const DecodeStatus status = set_.accept(frame, t_reference_ns);
    if (status != DecodeStatus::complete) return status;
    RawReader reader{kPoseSignals, set_.raw(), t_reference_ns};
    out.counter = set_.counter();
    reader.get(out.t_valid_ns);
    reader.get(out.motion);
    return status;
}

// --- Heartbeat --------------------------------------------------------------------------------------------------

CanFrame encode(const Heartbeat& h) noexcept {
    RawWriter w{kHeartbeatSignals};
    w.raw[w.i++] = to_us(h.t_ns) & raw_max(false, kHeartbeatTimeBits);
    w.put(h.state), w.put(h.no_command), w.put(h.stale), w.put(h.deadline_missed), w.put(h.output_dropped);
    return encode_classic(kHeartbeatLayout, w.raw, h.counter, kHeartbeatId)[0];
}

DecodeStatus decode(const CanFrame& frame, std::int64_t t_reference_ns, Heartbeat& out) noexcept {
    SetDecoder set(kHeartbeatLayout, kHeartbeatId, check<kHeartbeatLayout>);
    const DecodeStatus status = set.accept(frame, t_reference_ns);
    if (status != DecodeStatus::complete) return status;
    RawReader r{kHeartbeatSignals, set.raw()};
    out.t_ns =
        1000 * unwrap_time(static_cast<std::uint64_t>(r.raw[r.i++]), kHeartbeatTimeBits, to_us(t_reference_ns));
    r.get(out.state), r.get(out.no_command), r.get(out.stale), r.get(out.deadline_missed),
        r.get(out.output_dropped);
    out.counter = set.counter();
    return status;
}

// --- Messages whose members are their signals -------------------------------------------------------------------

namespace {

/// A Codec is how a message becomes signals and back. `kMembers` are in the order of the signals.
template <class Message, const SetLayout& kLayout, std::uint32_t kBaseId, auto kCounter, auto... kMembers>
struct MemberCodec {
    static constexpr const SetLayout& layout = kLayout;
    static std::uint32_t base_id(std::uint8_t) noexcept { return kBaseId; }
    static std::uint8_t camera(const Message&) noexcept { return 0; }
    static std::uint8_t counter(const Message& m) noexcept { return static_cast<std::uint8_t>(m.*kCounter); }
    static RawSignals raw_of(const Message& m) noexcept {
        RawWriter writer{layout.signals};
        (writer.put(m.*kMembers), ...);
        return writer.raw;
    }
    static DecodeStatus check(const RawSignals& raw) noexcept { return narpa::check<kLayout>(raw); }
    static void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns,
                     Message& out) noexcept {
        out.*kCounter = counter;  // where this is a frame or cycle number, its signal is read in full below
        RawReader reader{layout.signals, raw, t_reference_ns};
        (reader.get(out.*kMembers), ...);
    }
};

template <class Message>
struct Codec;

template <>
struct Codec<ActuatorCommand>
    : MemberCodec<ActuatorCommand, kActuatorLayout, kActuatorBaseId, &ActuatorCommand::counter,
                  &ActuatorCommand::t_ns, &ActuatorCommand::impulse_n_s, &ActuatorCommand::angular_impulse_n_m_s,
                  &ActuatorCommand::leg, &ActuatorCommand::phase, &ActuatorCommand::abort> {};

using N = NavigationEstimate;
template <>
struct Codec<N> : MemberCodec<N, kNavigationLayout, kNavigationBaseId, &N::cycle, &N::t_ns, &N::T_chaser_target,
                              &N::sigma_position_m, &N::sigma_rotation_rad, &N::cycle, &N::frames, &N::sweeps> {};

template <>
struct Codec<AttitudeReport>
    : MemberCodec<AttitudeReport, kAttitudeLayout, kAttitudeBaseId, &AttitudeReport::counter, &AttitudeReport::t_ns,
                  &AttitudeReport::q_world_chaser, &AttitudeReport::rate_rad_s> {};

template <>
struct Codec<DynamicsReport>
    : MemberCodec<DynamicsReport, kDynamicsLayout, kDynamicsBaseId, &DynamicsReport::counter, &DynamicsReport::t_ns,
                  &DynamicsReport::t_start_ns, &DynamicsReport::phase> {};

// --- LiDAR beams: range and velocity may be missing --------------------------------------------------------------

using B = LidarBeamReport;
using BeamMembers = MemberCodec<B, kLidarBeamLayout, kLidarBeamBaseId, &B::counter, &B::lidar, &B::beam, &B::t_ns,
                                &B::range_m, &B::velocity_m_s>;

template <>
struct Codec<LidarBeamReport> : BeamMembers {
    static DecodeStatus check(const RawSignals&) noexcept { return DecodeStatus::complete; }
};

// --- Cameras that are operated while they run -------------------------------------------------------------------

/// Calls f with each member of the settings, in the order of camera_setting_signals.
template <class Settings>
void for_each_setting(Settings& s, const auto& f) noexcept {
    f(s.running), f(s.trigger), f(s.auto_exposure), f(s.binning), f(s.gain_cdb), f(s.exposure_ns);
    if constexpr (std::is_same_v<std::remove_const_t<Settings>, CameraCommand>)
        f(s.region_x), f(s.region_y), f(s.region_width), f(s.region_height);
    else
        f(s.region.x), f(s.region.y), f(s.region.width), f(s.region.height);
    f(s.period_ns);
}

struct PutSetting {
    RawWriter& writer;
    template <class Value>
    void operator()(const std::optional<Value>& value) const noexcept {
        writer.raw[writer.i++] = value ? static_cast<std::int64_t>(*value) : kNotAvailable;
    }
    template <class Value>
    void operator()(const Value& value) const noexcept {
        writer.raw[writer.i++] = static_cast<std::int64_t>(value);
    }
};
struct GetSetting {
    RawReader& reader;
    template <class Value>
    void operator()(std::optional<Value>& value) const noexcept {
        value.reset();
        if (reader.raw[reader.i] != kNotAvailable) return (*this)(value.emplace());
        ++reader.i;
    }
    /// What the member cannot hold becomes its largest value, which no camera accepts.
    template <class Value>
    void operator()(Value& value) const noexcept {
        const std::int64_t raw = reader.raw[reader.i++];
        if constexpr (std::is_integral_v<Value>)
            value = std::in_range<Value>(raw) ? static_cast<Value>(raw) : std::numeric_limits<Value>::max();
        else
            value = static_cast<Value>(raw);
    }
    void operator()(bool& value) const noexcept { value = reader.raw[reader.i++] != 0; }
};

/// Refuses negative and unknown choices. Whether other values are possible is for the camera to decide.
DecodeStatus check_command(const RawSignals& raw, SignalTable signals) noexcept {
    const auto is_negative = [&](std::size_t i) { return raw[i] < 0 && raw[i] != kNotAvailable; };
    for (std::size_t i = 0; i < signals.size(); ++i)
        if (!signals[i].choices.empty() && is_negative(i)) return DecodeStatus::not_a_number;
    return has_known_choices(raw, signals) ? DecodeStatus::complete : DecodeStatus::not_a_number;
}

/// Refuses negative values (except of the gain), unknown choices, and values that do not fit their member.
DecodeStatus check_settings(const RawSignals& raw, SignalTable signals) noexcept {
    if (!has_known_choices(raw, signals)) return DecodeStatus::not_a_number;
    for (std::size_t i = 0; i < signals.size(); ++i) {
        const bool gain = signals[i].unit == "dB", pixels = signals[i].unit == "px";
        const std::int64_t most = signals[i].name == "Binning" ? 255 : pixels ? 65535 : raw_max(true, 62);
        if (raw[i] == kNotAvailable || (raw[i] < 0 && !gain) || raw[i] > most) return DecodeStatus::not_a_number;
    }
    return DecodeStatus::complete;
}

template <>
struct Codec<CameraCommand> {
    static constexpr const SetLayout& layout = kCameraCommandLayout;
    static std::uint32_t base_id(std::uint8_t) noexcept { return kCameraCommandBaseId; }
    static std::uint8_t camera(const CameraCommand&) noexcept { return 0; }
    static std::uint8_t counter(const CameraCommand& c) noexcept { return c.counter; }
    static RawSignals raw_of(const CameraCommand& c) noexcept {
        RawWriter writer{layout.signals};
        writer.put(c.camera);
        for_each_setting(c, PutSetting{writer});
        return writer.raw;
    }
    static DecodeStatus check(const RawSignals& raw) noexcept { return check_command(raw, layout.signals); }
    static void read(const RawSignals& raw, std::uint8_t counter, std::int64_t, CameraCommand& out) noexcept {
        RawReader reader{layout.signals, raw};
        out.counter = counter;
        reader.get(out.camera);
        for_each_setting(out, GetSetting{reader});
    }
    static void read_refused(const RawSignals& raw, std::uint8_t counter, CameraCommand& out) noexcept {
        out.counter = counter;
        RawReader{layout.signals, raw}.get(out.camera);
    }
};

template <>
struct Codec<CameraState> {
    static constexpr const SetLayout& layout = kCameraStateLayout;
    static std::uint32_t base_id(std::uint8_t) noexcept { return kCameraStateBaseId; }
    static std::uint8_t camera(const CameraState&) noexcept { return 0; }
    static std::uint8_t counter(const CameraState& s) noexcept { return static_cast<std::uint8_t>(s.frame); }
    static RawSignals raw_of(const CameraState& s) noexcept {
        RawWriter writer{layout.signals};
        writer.put(s.frame), writer.put(s.camera), writer.put(s.command_counter);
        for_each_setting(s.settings, PutSetting{writer});
        return writer.raw;
    }
    static DecodeStatus check(const RawSignals& raw) noexcept { return check_settings(raw, layout.signals); }
    static void read(const RawSignals& raw, std::uint8_t, std::int64_t, CameraState& out) noexcept {
        RawReader reader{layout.signals, raw};
        reader.get(out.frame), reader.get(out.camera), reader.get(out.command_counter);
        for_each_setting(out.settings, GetSetting{reader});
    }
};

template <>
struct Codec<CameraTrigger>
    : MemberCodec<CameraTrigger, kCameraTriggerLayout, kCameraTriggerBaseId, &CameraTrigger::counter,
                  &CameraTrigger::cameras, &CameraTrigger::at_once, &CameraTrigger::t_ns> {
    static void read_refused(const RawSignals& raw, std::uint8_t counter, CameraTrigger& out) noexcept {
        out.counter = counter;
        RawReader{layout.signals, raw}.get(out.cameras);
    }
};

using R = CameraReply;
template <>
struct Codec<R> : MemberCodec<R, kCameraReplyLayout, kCameraReplyBaseId, &R::counter, &R::camera, &R::to_trigger,
                              &R::answer, &R::t_ns> {};

// --- Estimate: a lost one has no pose ---------------------------------------------------------------------------

using E = EstimateReport;
using EstimateMembers =
    MemberCodec<E, kEstimateLayout, kEstimateBaseId, &E::frame, &E::t_ns, &E::T_camera_target, &E::sigma_position_m,
                &E::sigma_rotation_rad, &E::frame, &E::camera, &E::state, &E::answer>;

template <>
struct Codec<EstimateReport> : EstimateMembers {
    static constexpr std::size_t kState = index_of(kEstimateSignals, "State");
    static constexpr auto kLost = static_cast<std::int64_t>(EstimateState::lost);

    static RawSignals raw_of(const EstimateReport& e) noexcept {
        RawSignals raw = EstimateMembers::raw_of(e);
        if (e.state != EstimateState::lost) return raw;
        for (std::size_t i = 1; i < index_of(kEstimateSignals, "Frame"); ++i)
            raw[i] =
                kEstimateSignals[i].is_signed ? kNotAvailable : raw_max(false, kEstimateSignals[i].classic.length);
        return raw;
    }
    static DecodeStatus check(const RawSignals& raw) noexcept {
        return raw[kState] == kLost ? DecodeStatus::complete : EstimateMembers::check(raw);
    }
    static void read(const RawSignals& raw, std::uint8_t counter, std::int64_t t_reference_ns, E& out) noexcept {
        const EstimateReport before = out;
        EstimateMembers::read(raw, counter, t_reference_ns, out);
        if (out.state != EstimateState::lost) return;
        out.T_camera_target = before.T_camera_target;
        out.sigma_position_m = before.sigma_position_m;
        out.sigma_rotation_rad = before.sigma_rotation_rad;
    }
};

// --- Frame ledger: by the table of its fields -------------------------------------------------------------------

constexpr std::size_t kExposureMid = index_of(kLedgerSignals, "ExposureMid"),
                      kPoseKnown = index_of(kLedgerSignals, "PoseKnown"),
                      kHandOver = index_of(kLedgerSignals, "HandOver");

/// True for times that are sent relative to exposure mid.
bool is_offset(const Signal& s) noexcept {
    return s.unit == "us";
}

/// A ledger's value as a signal; `t_mid_ns` is its exposure mid.
std::int64_t to_raw(const Signal& s, std::int64_t t_mid_ns, std::int64_t t_ns) noexcept {
    if (!is_offset(s)) return time_steps(t_ns);
    const std::int64_t limit = raw_max(true, s.fd.length);
    return std::clamp(to_us(t_ns - t_mid_ns), -limit, limit);
}
std::int64_t to_raw(const Signal& s, std::int64_t, float value) noexcept {
    if (!(value >= 0)) return s.is_signed ? kNotAvailable : 0;
    const double limit = static_cast<double>(raw_max(s.is_signed, s.fd.length));
    return std::llround(std::min(static_cast<double>(value) * s.steps_per_unit, limit));
}
std::int64_t to_raw(const Signal&, std::int64_t, const FrameLedger::Passes& passes) noexcept {
    return std::ranges::count_if(passes, [](std::uint32_t samples) { return samples > 0; });
}
template <class Whole>
std::int64_t to_raw(const Signal& s, std::int64_t, Whole value) noexcept {
    const auto limit = static_cast<std::uint64_t>(raw_max(false, s.fd.length));
    return static_cast<std::int64_t>(std::min(static_cast<std::uint64_t>(value), limit));
}

/// A signal as a ledger's value.
struct FromRaw {
    const Signal& s;
    std::int64_t raw, t_mid_ns, t_reference_ns;

    void operator()(std::int64_t& t_ns) const noexcept {
        t_ns = raw == kNotAvailable ? 0 : is_offset(s) ? t_mid_ns + 1000 * raw : time_of(raw, t_reference_ns);
    }
    void operator()(float& value) const noexcept {
        value = raw == kNotAvailable ? -1.0f : static_cast<float>(static_cast<double>(raw) / s.steps_per_unit);
    }
    void operator()(FrameLedger::Passes&) const noexcept {}
    template <class Whole>
    void operator()(Whole& value) const noexcept {
        value = static_cast<Whole>(raw);
    }
};

template <>
struct Codec<FrameLedger> {
    static constexpr const SetLayout& layout = kLedgerLayout;
    static std::uint32_t base_id(std::uint8_t camera) noexcept { return ledger_base_id(camera); }
    static std::uint8_t camera(const FrameLedger& l) noexcept { return l.camera; }
    static std::uint8_t counter(const FrameLedger& l) noexcept { return static_cast<std::uint8_t>(l.frame); }
    static RawSignals raw_of(const FrameLedger& l) noexcept {
        RawSignals raw{};
        for (std::size_t i = 0; i < kLedgerSignals.size(); ++i)
            visit_field(kLedgerFields[i], l,
                        [&](const auto& value) { raw[i] = to_raw(kLedgerSignals[i], l.t_exposure_mid_ns, value); });
        raw[kPoseKnown] = l.t_pose_ns != 0;
        if (l.t_hand_over_ns == 0) raw[kHandOver] = kNotAvailable;
        return raw;
    }
    static DecodeStatus check(const RawSignals& raw) noexcept {
        return has_known_choices(raw, kLedgerSignals) ? DecodeStatus::complete : DecodeStatus::not_a_number;
    }
    static void read(const RawSignals& raw, std::uint8_t, std::int64_t t_reference_ns, FrameLedger& out) noexcept {
        out = {};
        const std::int64_t t_mid_ns = time_of(raw[kExposureMid], t_reference_ns);
        for (std::size_t i = 0; i < kLedgerSignals.size(); ++i)
            visit_field(kLedgerFields[i], out, FromRaw{kLedgerSignals[i], raw[i], t_mid_ns, t_reference_ns});
        if (raw[kPoseKnown] == 0) out.t_pose_ns = 0;
    }
};

}  // namespace

template <class Message>
FrameSet encode_classic(const Message& m) noexcept {
    using C = Codec<Message>;
    return encode_classic(C::layout, C::raw_of(m), C::counter(m), C::base_id(C::camera(m)));
}

template <class Message>
CanFrame encode_fd(const Message& m) noexcept {
    using C = Codec<Message>;
    return encode_fd(C::layout, C::raw_of(m), C::counter(m), C::base_id(C::camera(m)));
}

template <class Message>
MessageDecoder<Message>::MessageDecoder(std::uint8_t camera) noexcept
    : set_(Codec<Message>::layout, Codec<Message>::base_id(camera), Codec<Message>::check) {}

template <class Message>
DecodeStatus MessageDecoder<Message>::accept(const CanFrame& frame, std::int64_t t_reference_ns,
                                             Message& out) noexcept {
    const DecodeStatus status = set_.accept(frame, t_reference_ns);
    if (status == DecodeStatus::complete) Codec<Message>::read(set_.raw(), set_.counter(), t_reference_ns, out);
    if constexpr (requires { Codec<Message>::read_refused(set_.raw(), set_.counter(), out); })
        if (status == DecodeStatus::not_a_number) Codec<Message>::read_refused(set_.raw(), set_.counter(), out);
    return status;
}

#define NARPA_CAN_MESSAGE(Message)                             \
    template FrameSet encode_classic(const Message&) noexcept; \
    template CanFrame encode_fd(const Message&) noexcept;      \
    template class MessageDecoder<Message>
NARPA_CAN_MESSAGE(FrameLedger);
NARPA_CAN_MESSAGE(EstimateReport);
NARPA_CAN_MESSAGE(ActuatorCommand);
NARPA_CAN_MESSAGE(NavigationEstimate);
NARPA_CAN_MESSAGE(AttitudeReport);
NARPA_CAN_MESSAGE(DynamicsReport);
NARPA_CAN_MESSAGE(CameraCommand);
NARPA_CAN_MESSAGE(CameraTrigger);
NARPA_CAN_MESSAGE(CameraReply);
NARPA_CAN_MESSAGE(CameraState);
NARPA_CAN_MESSAGE(LidarBeamReport);
#undef NARPA_CAN_MESSAGE

}  // namespace narpa
