/// protocols/estimate.h - a relative pose that narpa estimated from one of its own frames.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "base/pose.h"

namespace narpa {

/// What an estimate is based on.
enum class EstimateState : std::uint8_t {
    lost,       ///< nothing: the frame gave no pose, and there is no earlier one
    predicted,  ///< the motion so far: the frame gave no credible pose
    measured,   ///< the frame
};
inline constexpr std::array<std::string_view, 3> kEstimateStates{"lost", "predicted", "measured"};

/// Quality of a pose that was estimated from one frame or sweep (estimator/uncertainty/answer.h).
enum class AnswerKind : std::uint8_t {
    good,          ///< correct within its covariance
    ambiguous,     ///< another pose explains the measurement nearly as well
    unobservable,  ///< the measurement does not constrain all degrees of freedom; correct in the others
    refused,       ///< no pose
};
inline constexpr std::array<std::string_view, 4> kAnswerKinds{"good", "ambiguous", "unobservable", "refused"};

struct EstimateReport {
    std::uint32_t frame = 0;
    std::uint8_t camera = 0;  ///< index of the camera in the scene
    EstimateState state = EstimateState::lost;
    AnswerKind answer = AnswerKind::good;  ///< of the frame alone
    std::int64_t t_ns = 0;                 ///< simulation clock: the middle of the exposure
    Rigid3 T_camera_target{};
    Vec3 sigma_rotation_rad{}, sigma_position_m{};  ///< standard deviations, camera axes
};

}  // namespace narpa
