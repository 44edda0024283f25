// Telemetry of narpa: heartbeat and frame ledgers (messages.h).
#include <algorithm>
#include <cmath>

#include "protocols/can/message_codec.h"

namespace narpa {
namespace {

constexpr int kHeartbeatTimeBits = 40;

/// Rounds to the nearest microsecond, halves upwards; exact for negative times.
std::int64_t to_us(std::int64_t t_ns) noexcept {
    const std::int64_t q = t_ns / 1000, r = t_ns % 1000;
    return q + (r >= 500 ? 1 : r < -500 ? -1 : 0);
}

constexpr std::size_t index_of(std::string_view signal) {
    return static_cast<std::size_t>(std::ranges::find(kLedgerSignals, signal, &Signal::name) -
                                    kLedgerSignals.begin());
}
constexpr std::size_t kExposureMid = index_of("ExposureMid"), kPoseKnown = index_of("PoseKnown"),
                      kHandOver = index_of("HandOver");

/// Of a time: after exposure mid.
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

RawSignals raw_of(const FrameLedger& l) noexcept {
    RawSignals raw{};
    for (std::size_t i = 0; i < kLedgerFields.size(); ++i)
        visit_field(kLedgerFields[i], l,
                    [&](const auto& value) { raw[i] = to_raw(kLedgerSignals[i], l.t_exposure_mid_ns, value); });
    raw[kPoseKnown] = l.t_pose_ns != 0;
    if (l.t_hand_over_ns == 0) raw[kHandOver] = kNotAvailable;
    return raw;
}

/// A signal as a ledger's value; `clock` gives the time of a raw value of 48 bits.
template <class Clock>
void from_raw(const Signal& s, std::int64_t raw, std::int64_t t_mid_ns, const Clock& clock, std::int64_t& t_ns) {
    t_ns = raw == kNotAvailable ? 0 : is_offset(s) ? t_mid_ns + 1000 * raw : clock(raw);
}
void from_raw(const Signal& s, std::int64_t raw, std::int64_t, const auto&, float& value) noexcept {
    value = raw == kNotAvailable ? -1.0f : static_cast<float>(static_cast<double>(raw) / s.steps_per_unit);
}
void from_raw(const Signal&, std::int64_t, std::int64_t, const auto&, FrameLedger::Passes&) noexcept {}
template <class Whole>
void from_raw(const Signal&, std::int64_t raw, std::int64_t, const auto&, Whole& value) noexcept {
    value = static_cast<Whole>(raw);
}

FrameLedger ledger_of(const RawSignals& raw, std::int64_t t_reference_ns) noexcept {
    const auto clock = [&](std::int64_t value) { return time_of(value, t_reference_ns); };
    const std::int64_t t_mid_ns = clock(raw[kExposureMid]);
    FrameLedger l;
    for (std::size_t i = 0; i < kLedgerFields.size(); ++i)
        visit_field(kLedgerFields[i], l,
                    [&](auto& value) { from_raw(kLedgerSignals[i], raw[i], t_mid_ns, clock, value); });
    if (raw[kPoseKnown] == 0) l.t_pose_ns = 0;
    return l;
}

}  // namespace

CanFrame encode(const Heartbeat& heartbeat) noexcept {
    RawSignals raw{};
    raw[kHeartbeatTime] = to_us(heartbeat.t_ns) & raw_max(false, kHeartbeatTimeBits);
    raw[kHeartbeatState] = static_cast<std::int64_t>(heartbeat.state);
    raw[kHeartbeatNoCommand] = heartbeat.no_command;
    raw[kHeartbeatStale] = heartbeat.stale;
    raw[kHeartbeatDeadlineMissed] = heartbeat.deadline_missed;
    raw[kHeartbeatOutputDropped] = heartbeat.output_dropped;
    return encode_classic(kHeartbeatLayout, raw, heartbeat.counter, kHeartbeatId)[0];
}

DecodeStatus decode(const CanFrame& frame, std::int64_t t_reference_ns, Heartbeat& out) noexcept {
    SetDecoder set(kHeartbeatLayout, kHeartbeatId, [](const RawSignals& raw) noexcept {
        return has_known_choices(raw, kHeartbeatSignals) ? DecodeStatus::complete : DecodeStatus::not_a_number;
    });
    const DecodeStatus status = set.accept(frame);
    if (status != DecodeStatus::complete) return status;
    const RawSignals& raw = set.raw();
    out.t_ns = 1000 * unwrap_time(static_cast<std::uint64_t>(raw[kHeartbeatTime]), kHeartbeatTimeBits,
                                  to_us(t_reference_ns));
    out.state = static_cast<RunState>(raw[kHeartbeatState]);
    out.no_command = raw[kHeartbeatNoCommand] != 0;
    out.stale = raw[kHeartbeatStale] != 0;
    out.deadline_missed = raw[kHeartbeatDeadlineMissed] != 0;
    out.output_dropped = raw[kHeartbeatOutputDropped] != 0;
    out.counter = set.counter();
    return status;
}

template <>
struct Codec<FrameLedger> {
    static constexpr const SetLayout& layout = kLedgerLayout;
    static std::uint32_t base_id(std::uint8_t camera) noexcept { return ledger_base_id(camera); }
    static std::uint8_t camera(const FrameLedger& l) noexcept { return l.camera; }
    static std::uint8_t counter(const FrameLedger& l) noexcept { return static_cast<std::uint8_t>(l.frame); }
    static RawSignals raw_of(const FrameLedger& l) noexcept { return narpa::raw_of(l); }
    static DecodeStatus check(const RawSignals& raw) noexcept {
        return has_known_choices(raw, kLedgerSignals) ? DecodeStatus::complete : DecodeStatus::not_a_number;
    }
    static void read(const RawSignals& raw, std::uint8_t, std::int64_t t_reference_ns, FrameLedger& out) noexcept {
        out = ledger_of(raw, t_reference_ns);
    }
};
NARPA_CAN_MESSAGE(FrameLedger);

}  // namespace narpa
