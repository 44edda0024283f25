// The pose that narpa estimates, on CAN (messages.h).
#include "protocols/can/message_codec.h"

namespace narpa {

template <>
struct Codec<EstimateReport> {
    static constexpr const SetLayout& layout = kEstimateLayout;
    static std::uint32_t base_id(std::uint8_t) noexcept { return kEstimateBaseId; }
    static std::uint8_t camera(const EstimateReport&) noexcept { return 0; }
    static std::uint8_t counter(const EstimateReport& e) noexcept { return static_cast<std::uint8_t>(e.frame); }

    static RawSignals raw_of(const EstimateReport& e) noexcept {
        RawSignals raw{};
        raw[kEstimateTime] = time_steps(e.t_ns);
        raw[kEstimateFrame] = e.frame;
        raw[kEstimateCamera] = e.camera;
        raw[kEstimateState] = static_cast<std::int64_t>(e.state);
        if (e.state == EstimateState::lost) {
            for (std::size_t i = kEstimatePosition; i < kEstimateFrame; ++i)
                raw[i] = kEstimateSignals[i].is_signed ? kNotAvailable
                                                       : raw_max(false, kEstimateSignals[i].classic.length);
            return raw;
        }
        put(raw, kEstimateSignals, kEstimatePosition, e.T_camera_target.t);
        put(raw, kEstimateSignals, kEstimateAttitude, e.T_camera_target.q);
        put(raw, kEstimateSignals, kEstimateSigmaPosition, e.sigma_position_m);
        put(raw, kEstimateSignals, kEstimateSigmaRotation, e.sigma_rotation_rad);
        return raw;
    }

    static DecodeStatus check(const RawSignals& raw) noexcept {
        const std::int64_t state = raw[kEstimateState];
        if (state >= static_cast<std::int64_t>(kEstimateStates.size())) return DecodeStatus::not_a_number;
        if (state == static_cast<std::int64_t>(EstimateState::lost)) return DecodeStatus::complete;
        for (std::size_t i = kEstimatePosition; i < kEstimateSigmaPosition; ++i)
            if (raw[i] == kNotAvailable) return DecodeStatus::not_a_number;
        return judge_attitude(attitude_of(raw, kEstimateSignals, kEstimateAttitude));
    }

    static void read(const RawSignals& raw, std::uint8_t, std::int64_t t_reference_ns,
                     EstimateReport& out) noexcept {
        out.frame = static_cast<std::uint32_t>(raw[kEstimateFrame]);
        out.camera = static_cast<std::uint8_t>(raw[kEstimateCamera]);
        out.state = static_cast<EstimateState>(raw[kEstimateState]);
        out.t_ns = time_of(raw[kEstimateTime], t_reference_ns);
        if (out.state == EstimateState::lost) return;
        out.T_camera_target = {normalized(attitude_of(raw, kEstimateSignals, kEstimateAttitude)),
                               vector_of(raw, kEstimateSignals, kEstimatePosition)};
        out.sigma_position_m = vector_of(raw, kEstimateSignals, kEstimateSigmaPosition);
        out.sigma_rotation_rad = vector_of(raw, kEstimateSignals, kEstimateSigmaRotation);
    }
};
NARPA_CAN_MESSAGE(EstimateReport);

}  // namespace narpa
