// The pose that narpa estimates, on CAN (messages.h).
#include "protocols/can/messages.h"
#include "protocols/can/signal_values.h"

namespace narpa {
namespace {

RawSignals raw_of(const EstimateReport& e) noexcept {
    RawSignals raw{};
    raw[kEstimateTime] = time_steps(e.t_ns);
    raw[kEstimateFrame] = e.frame;
    raw[kEstimateCamera] = e.camera;
    raw[kEstimateState] = static_cast<std::int64_t>(e.state);
    if (e.state == EstimateState::lost) {
        for (std::size_t i = kEstimatePosition; i < kEstimateFrame; ++i)
            raw[i] =
                kEstimateSignals[i].is_signed ? kNotAvailable : raw_max(false, kEstimateSignals[i].classic.length);
        return raw;
    }
    put(raw, kEstimateSignals, kEstimatePosition, e.T_camera_target.t);
    put(raw, kEstimateSignals, kEstimateAttitude, e.T_camera_target.q);
    put(raw, kEstimateSignals, kEstimateSigmaPosition, e.sigma_position_m);
    put(raw, kEstimateSignals, kEstimateSigmaRotation, e.sigma_rotation_rad);
    return raw;
}

DecodeStatus verdict(const RawSignals& raw) noexcept {
    const std::int64_t state = raw[kEstimateState];
    if (state >= static_cast<std::int64_t>(kEstimateStates.size())) return DecodeStatus::not_a_number;
    if (state == static_cast<std::int64_t>(EstimateState::lost)) return DecodeStatus::complete;
    for (std::size_t i = kEstimatePosition; i < kEstimateSigmaPosition; ++i)
        if (raw[i] == kNotAvailable) return DecodeStatus::not_a_number;
    return judge_attitude(attitude_of(raw, kEstimateSignals, kEstimateAttitude));
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
    out.T_camera_target = {normalized(attitude_of(raw, kEstimateSignals, kEstimateAttitude)),
                           vector_of(raw, kEstimateSignals, kEstimatePosition)};
    out.sigma_position_m = vector_of(raw, kEstimateSignals, kEstimateSigmaPosition);
    out.sigma_rotation_rad = vector_of(raw, kEstimateSignals, kEstimateSigmaRotation);
    return status;
}

}  // namespace narpa
