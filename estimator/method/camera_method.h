/// estimator/method/camera_method.h - the ways in which a pose is found in a camera's frame.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace narpa {

enum class CameraMethod : std::uint8_t {
    features,  ///< points of the frame and of a render at the guess (estimator/features)
    dense,     ///< all pixels (estimator/dense)
};
inline constexpr std::array<std::string_view, 2> kCameraMethods{"features", "dense"};

}  // namespace narpa
