// Telemetry of narpa: heartbeat and frame ledgers (messages.h).
#include <algorithm>
#include <cmath>

#include "protocols/can/messages.h"
#include "protocols/can/signal_values.h"

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
    const auto clock = [&](std::int64_t value) {
        return unwrap_time(static_cast<std::uint64_t>(value), kTimeBits, t_reference_ns);
    };
    const std::int64_t t_mid_ns = clock(raw[kExposureMid]);
    FrameLedger l;
    for (std::size_t i = 0; i < kLedgerFields.size(); ++i)
        visit_field(kLedgerFields[i], l,
                    [&](auto& value) { from_raw(kLedgerSignals[i], raw[i], t_mid_ns, clock, value); });
    if (raw[kPoseKnown] == 0) l.t_pose_ns = 0;
    return l;
}

DecodeStatus known_choices(const RawSignals& raw) noexcept {
    for (std::size_t i = 0; i < kLedgerSignals.size(); ++i) {
        const auto choices = static_cast<std::int64_t>(kLedgerSignals[i].choices.size());
        if (choices > 0 && raw[i] >= choices) return DecodeStatus::not_a_number;
    }
    return DecodeStatus::complete;
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
    return encode_classic(kHeartbeatLayout, raw, heartbeat.counter, kHeartbeatId, 0);
}

DecodeStatus decode(const CanFrame& frame, std::int64_t t_reference_ns, Heartbeat& out) noexcept {
    constexpr auto known_state = [](const RawSignals& raw) noexcept {
        return raw[kHeartbeatState] < static_cast<std::int64_t>(kRunStates.size()) ? DecodeStatus::complete
                                                                                   : DecodeStatus::not_a_number;
    };
    SetDecoder set(kHeartbeatLayout, kHeartbeatId, known_state);
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

LedgerFrames encode_classic(const FrameLedger& ledger) noexcept {
    const RawSignals raw = raw_of(ledger);
    LedgerFrames out;
    for (std::size_t i = 0; i < out.size(); ++i)
        out[i] = encode_classic(kLedgerLayout, raw, static_cast<std::uint8_t>(ledger.frame),
                                ledger_base_id(ledger.camera), i);
    return out;
}

CanFrame encode_fd(const FrameLedger& ledger) noexcept {
    return encode_fd(kLedgerLayout, raw_of(ledger), static_cast<std::uint8_t>(ledger.frame),
                     ledger_base_id(ledger.camera));
}

LedgerDecoder::LedgerDecoder(std::uint8_t camera) noexcept
    : set_(kLedgerLayout, ledger_base_id(camera), known_choices) {}

DecodeStatus LedgerDecoder::accept(const CanFrame& frame, std::int64_t t_reference_ns, FrameLedger& out) noexcept {
    const DecodeStatus status = set_.accept(frame);
    if (status != DecodeStatus::complete) return status;
    out = ledger_of(set_.raw(), t_reference_ns);
    return status;
}

}  // namespace narpa
