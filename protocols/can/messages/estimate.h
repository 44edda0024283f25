/// protocols/can/messages/estimate.h - the pose that narpa estimates from its own frames. A lost one has no pose.
#pragma once

#include "protocols/can/codec.h"
#include "protocols/estimate.h"

namespace narpa {

inline constexpr std::uint32_t kEstimateBaseId = 0x710;
inline constexpr auto kEstimateStateChoices = numbered(kEstimateStates);
inline constexpr auto kAnswerChoices = numbered(kAnswerKinds);

inline constexpr std::array<std::string_view, 10> kEstimateFrames{
    "EstimateTime",       "EstimatePositionX", "EstimatePositionY",  "EstimatePositionZ",  "EstimateAttitudeWX",
    "EstimateAttitudeYZ", "EstimateSigmaXY",   "EstimateSigmaZRotX", "EstimateSigmaRotYZ", "EstimateState"};

inline constexpr auto kEstimateSignals = place_fd_signals(
    pose_signals("Middle of the exposure: simulation clock modulo 2^48 ns", "Target's origin in camera axes",
                 "Hamilton quaternion, target to camera"),
    sigma_signals("Standard deviation of the attitude about the camera's axis"),
    std::to_array<Signal>({
        {"Frame", "", "Number of the frame that it was estimated from", 1, false, {9, 0, 32}},
        {"Camera", "", "Index of the camera in the scene", 1, false, {9, 32, 8}},
        {"State", "", "Source of the estimate", 1, false, {9, 40, 3}, {}, kEstimateStateChoices},
        {"Answer", "", "Class of the pose estimated from the frame", 1, false, {9, 43, 3}, {}, kAnswerChoices},
    }));

inline constexpr SetLayout kEstimateLayout =
    describe_set("Estimate", "emulator's estimate", "Pose of the target that narpa estimates from its own frames",
                 kEstimateBaseId, kFromNarpa, kEstimateFrames, kEstimateSignals);

template <>
struct Codec<EstimateReport> {
    static constexpr const SetLayout& layout = kEstimateLayout;
    static auto& counter(auto& m) noexcept { return m.frame; }
    static void fields(auto& m, const auto& each) noexcept {
        each(m.t_ns, m.T_camera_target, m.sigma_position_m, m.sigma_rotation_rad, m.frame, m.camera, m.state,
             m.answer);
    }

    /// In state `lost`, pose and deviations are "not available" and are not read.
    static void encoded(const EstimateReport& e, RawSignals& raw) noexcept {
        if (e.state != EstimateState::lost) return;
        for (std::size_t i = 1; i < index_of(kEstimateSignals, "Frame"); ++i)
            raw[i] =
                kEstimateSignals[i].is_signed ? kNotAvailable : raw_max(false, kEstimateSignals[i].classic.length);
    }
    static DecodeStatus check(const RawSignals& raw) noexcept {
        constexpr std::size_t kState = index_of(kEstimateSignals, "State");
        const bool lost = raw[kState] == static_cast<std::int64_t>(EstimateState::lost);
        return lost ? DecodeStatus::complete : check_signals(layout.signals, raw, false);
    }
    static void decoded(const EstimateReport& before, EstimateReport& out) noexcept {
        if (out.state != EstimateState::lost) return;
        out.T_camera_target = before.T_camera_target;
        out.sigma_position_m = before.sigma_position_m;
        out.sigma_rotation_rad = before.sigma_rotation_rad;
    }
};
using EstimateDecoder = MessageDecoder<EstimateReport>;

}  // namespace narpa
