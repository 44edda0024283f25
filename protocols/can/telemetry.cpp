// What narpa says about itself: heartbeat and frame ledgers (messages.h).
#include <algorithm>
#include <cmath>

#include "protocols/can/messages.h"

namespace narpa {
namespace {

constexpr int kLedgerTimeBits = 48, kHeartbeatTimeBits = 40, kOffsetBits = 24, kCountBits = 40;

std::int64_t low_bits(std::int64_t value, int bits) noexcept {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(value) & ((std::uint64_t{1} << bits) - 1));
}

/// Rounds to the nearest microsecond, halves upwards; floor division keeps negative times right.
std::int64_t to_us(std::int64_t t_ns) noexcept {
    const std::int64_t q = t_ns / 1000, r = t_ns % 1000;
    return q + (r >= 500 ? 1 : r < -500 ? -1 : 0);
}

std::int64_t offset_us(std::int64_t t_ns, std::int64_t t_mid_ns) noexcept {
    constexpr std::int64_t limit = raw_max(true, kOffsetBits);
    return std::clamp(to_us(t_ns - t_mid_ns), -limit, limit);
}

/// Not a number is 0.
std::int64_t steps(float value, double steps_per_unit, std::int64_t limit) noexcept {
    const double wanted = static_cast<double>(value) * steps_per_unit;
    if (!(wanted > 0)) return 0;
    return wanted < static_cast<double>(limit) ? std::llround(wanted) : limit;
}

std::int64_t saturated(std::uint64_t count) noexcept {
    constexpr auto limit = static_cast<std::uint64_t>(raw_max(false, kCountBits));
    return static_cast<std::int64_t>(std::min(count, limit));
}

RawSignals raw_of(const FrameLedger& l) noexcept {
    RawSignals raw{};
    raw[kLedgerFrame] = l.frame;
    raw[kLedgerCamera] = l.camera;
    raw[kLedgerPoseCounter] = l.pose_counter;
    raw[kLedgerExposureMid] = low_bits(l.t_exposure_mid_ns, kLedgerTimeBits);
    raw[kLedgerPoseTime] = low_bits(l.t_pose_ns, kLedgerTimeBits);
    raw[kLedgerExposureStart] = offset_us(l.t_exposure_start_ns, l.t_exposure_mid_ns);
    raw[kLedgerExposureEnd] = offset_us(l.t_exposure_end_ns, l.t_exposure_mid_ns);
    raw[kLedgerRenderStart] = offset_us(l.t_render_start_ns, l.t_exposure_mid_ns);
    raw[kLedgerRenderEnd] = offset_us(l.t_render_end_ns, l.t_exposure_mid_ns);
    raw[kLedgerHandOver] = l.t_hand_over_ns == 0 ? kNotAvailable : offset_us(l.t_hand_over_ns, l.t_exposure_mid_ns);
    raw[kLedgerDeadline] = offset_us(l.t_deadline_ns, l.t_exposure_mid_ns);
    raw[kLedgerSamplesPerPixel] = steps(l.samples_per_pixel, kSamplesPerPixelSteps, raw_max(false, 24));
    raw[kLedgerExpectedError] =
        l.expected_error >= 0 ? steps(l.expected_error, kExpectedErrorSteps, raw_max(true, 24)) : kNotAvailable;
    raw[kLedgerPoseStale] = l.pose_stale;
    raw[kLedgerDeadlineMet] = l.deadline_met;
    raw[kLedgerPoseKnown] = l.t_pose_ns != 0;
    raw[kLedgerStep] = l.step;
    raw[kLedgerBudgetKind] = static_cast<std::int64_t>(l.budget_kind);
    raw[kLedgerDelivery] = static_cast<std::int64_t>(l.delivery);
    raw[kLedgerPasses] = std::ranges::count_if(l.passes, [](std::uint32_t samples) { return samples > 0; });
    raw[kLedgerSamples] = saturated(l.samples);
    raw[kLedgerRays] = saturated(l.rays);
    raw[kLedgerBudget] = saturated(l.budget);
    return raw;
}

DecodeStatus known_choices(const RawSignals& raw) noexcept {
    const bool known = raw[kLedgerStep] < static_cast<std::int64_t>(kLedgerSteps.size()) &&
                       raw[kLedgerBudgetKind] < static_cast<std::int64_t>(kLedgerBudgetKinds.size());
    return known ? DecodeStatus::complete : DecodeStatus::not_a_number;
}

}  // namespace

CanFrame encode(const Heartbeat& heartbeat) noexcept {
    RawSignals raw{};
    raw[kHeartbeatTime] = low_bits(to_us(heartbeat.t_ns), kHeartbeatTimeBits);
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
    const RawSignals& raw = set_.raw();
    const auto clock = [&](std::size_t i) {
        return unwrap_time(static_cast<std::uint64_t>(raw[i]), kLedgerTimeBits, t_reference_ns);
    };
    const std::int64_t mid = clock(kLedgerExposureMid);
    const auto after_mid = [&](std::size_t i) { return raw[i] == kNotAvailable ? 0 : mid + 1000 * raw[i]; };
    out.frame = static_cast<std::uint32_t>(raw[kLedgerFrame]);
    out.camera = static_cast<std::uint8_t>(raw[kLedgerCamera]);
    out.pose_counter = static_cast<std::uint8_t>(raw[kLedgerPoseCounter]);
    out.pose_stale = raw[kLedgerPoseStale] != 0;
    out.deadline_met = raw[kLedgerDeadlineMet] != 0;
    out.delivery = static_cast<Delivery>(raw[kLedgerDelivery]);
    out.step = static_cast<std::uint8_t>(raw[kLedgerStep]);
    out.budget_kind = static_cast<BudgetKind>(raw[kLedgerBudgetKind]);
    out.budget = static_cast<std::uint64_t>(raw[kLedgerBudget]);
    out.samples = static_cast<std::uint64_t>(raw[kLedgerSamples]);
    out.rays = static_cast<std::uint64_t>(raw[kLedgerRays]);
    out.passes = {};
    out.samples_per_pixel =
        static_cast<float>(static_cast<double>(raw[kLedgerSamplesPerPixel]) / kSamplesPerPixelSteps);
    out.expected_error =
        raw[kLedgerExpectedError] == kNotAvailable
            ? -1.0f
            : static_cast<float>(static_cast<double>(raw[kLedgerExpectedError]) / kExpectedErrorSteps);
    out.t_pose_ns = raw[kLedgerPoseKnown] != 0 ? clock(kLedgerPoseTime) : 0;
    out.t_exposure_start_ns = after_mid(kLedgerExposureStart);
    out.t_exposure_mid_ns = mid;
    out.t_exposure_end_ns = after_mid(kLedgerExposureEnd);
    out.t_render_start_ns = after_mid(kLedgerRenderStart);
    out.t_render_end_ns = after_mid(kLedgerRenderEnd);
    out.t_hand_over_ns = after_mid(kLedgerHandOver);
    out.t_deadline_ns = after_mid(kLedgerDeadline);
    return status;
}

}  // namespace narpa
