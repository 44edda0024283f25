/// renderer/projection/distortion.h - lens distortion coefficients from a calibration.
#pragma once

#include <memory>
#include <vector>

#include "renderer/projection/pinhole.h"

namespace narpa {

/// In OpenCV's order and definition: brown_conrady.h, kannala_brandt.h.
struct Distortion {
    enum class Model : std::uint8_t {
        opencv,   ///< k1, k2, p1, p2 [, k3 [, k4, k5, k6 [, s1, s2, s3, s4]]]: 4, 5, 8 or 12 numbers
        fisheye,  ///< k1, k2, k3, k4
    };
    Model model = Model::opencv;
    std::vector<double> coefficients;
};

/// Null if the model does not take this number of coefficients.
[[nodiscard]] std::shared_ptr<const CameraModel> distorted(const Pinhole& pinhole, const Distortion& distortion);

}  // namespace narpa
