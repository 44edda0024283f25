// The pose that narpa estimates, on CAN (messages.h).
#include <algorithm>
#include <cmath>

#include "protocols/can/messages.h"

namespace narpa {
namespace {

constexpr int kTimeBits = 48;
constexpr double kUnitTolerance = 1e-3;

/// In the signal's steps, within its range; what is no number is not available.
std::int64_t steps(double value, const Signal& signal) noexcept {
    const auto limit = static_cast<double>(raw_max(signal.is_signed, signal.classic.length));
    const double scaled = std::round(value * signal.steps_per_unit);
    if (std::isnan(scaled)) return signal.is_signed ? kNotAvailable : static_cast<std::int64_t>(limit);
    return static_cast<std::int64_t>(std::clamp(scaled, signal.is_signed ? -limit : 0.0, limit));
}

void put(RawSignals& raw, std::size_t first, const Vec3& v) noexcept {
    for (int k = 0; k < 3; ++k) {
        const std::size_t i = first + static_cast<std::size_t>(k);
        raw[i] = steps(v[k], kEstimateSignals[i]);
    }
}

RawSignals raw_of(const EstimateReport& e) noexcept {
    RawSignals raw{};
    raw[kEstimateTime] = static_cast<std::int64_t>(static_cast<std::uint64_t>(e.t_ns) &
                                                   static_cast<std::uint64_t>(raw_max(false, kTimeBits)));
    raw[kEstimateFrame] = e.frame;
    raw[kEstimateCamera] = e.camera;
    raw[kEstimateState] = static_cast<std::int64_t>(e.state);
    if (e.state == EstimateState::lost) {
        for (std::size_t i = kEstimatePosition; i < kEstimateFrame; ++i)
            raw[i] =
                kEstimateSignals[i].is_signed ? kNotAvailable : raw_max(false, kEstimateSignals[i].classic.length);
        return raw;
    }
    put(raw, kEstimatePosition, e.T_camera_target.t);
    const Quat& q = e.T_camera_target.q;
    raw[kEstimateAttitude] = steps(q.w, kEstimateSignals[kEstimateAttitude]);
    put(raw, kEstimateAttitude + 1, q.vec());
    put(raw, kEstimateSigmaPosition, e.sigma_position_m);
    put(raw, kEstimateSigmaRotation, e.sigma_rotation_rad);
    return raw;
}

double value(const RawSignals& raw, std::size_t i) noexcept {
    return static_cast<double>(raw[i]) / kEstimateSignals[i].steps_per_unit;
}
Vec3 vector(const RawSignals& raw, std::size_t first) noexcept {
    return {value(raw, first), value(raw, first + 1), value(raw, first + 2)};
}
Quat attitude(const RawSignals& raw) noexcept {
    const Vec3 v = vector(raw, kEstimateAttitude + 1);
    return {value(raw, kEstimateAttitude), v.x, v.y, v.z};
}

DecodeStatus verdict(const RawSignals& raw) noexcept {
    const std::int64_t state = raw[kEstimateState];
    if (state >= static_cast<std::int64_t>(kEstimateStates.size())) return DecodeStatus::not_a_number;
    if (state == static_cast<std::int64_t>(EstimateState::lost)) return DecodeStatus::complete;
    for (std::size_t i = kEstimatePosition; i < kEstimateSigmaPosition; ++i)
        if (raw[i] == kNotAvailable) return DecodeStatus::not_a_number;
    return std::abs(norm(attitude(raw)) - 1.0) <= kUnitTolerance ? DecodeStatus::complete : DecodeStatus::not_unit;
}

}  // namespace

EstimateFrames encode_classic(const EstimateReport& estimate) noexcept {
    const RawSignals raw = raw_of(estimate);
    EstimateFrames out;
    for (std::size_t i = 0; i < out.size(); ++i)
        out[i] =
            encode_classic(kEstimateLayout, raw, static_cast<std::uint8_t>(estimate.frame), kEstimateBaseId, i);
    return out;
}

CanFrame encode_fd(const EstimateReport& estimate) noexcept {
    return encode_fd(kEstimateLayout, raw_of(estimate), static_cast<std::uint8_t>(estimate.frame), kEstimateBaseId);
}

EstimateDecoder::EstimateDecoder() noexcept : set_(kEstimateLayout, kEstimateBaseId, verdict) {}

DecodeStatus EstimateDecoder::accept(const CanFrame& frame, std::int64_t t_reference_ns,
                                     EstimateReport& out) noexcept {
    const DecodeStatus status = set_.accept(frame);
    if (status != DecodeStatus::complete) return status;
    const RawSignals& raw = set_.raw();
    out.frame = static_cast<std::uint32_t>(raw[kEstimateFrame]);
    out.camera = static_cast<std::uint8_t>(raw[kEstimateCamera]);
    out.state = static_cast<EstimateState>(raw[kEstimateState]);
    out.t_ns = unwrap_time(static_cast<std::uint64_t>(raw[kEstimateTime]), kTimeBits, t_reference_ns);
    if (out.state == EstimateState::lost) return status;
    out.T_camera_target = {normalized(attitude(raw)), vector(raw, kEstimatePosition)};
    out.sigma_position_m = vector(raw, kEstimateSigmaPosition);
    out.sigma_rotation_rad = vector(raw, kEstimateSigmaRotation);
    return status;
}

}  // namespace narpa
