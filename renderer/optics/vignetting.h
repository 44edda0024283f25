/// renderer/optics/vignetting.h - less light far from the optical axis.
#pragma once

#include <array>

#include "renderer/optics/optical_effect.h"

namespace narpa {

/// The share of light at theta radians from the optical axis: cos^4 theta (if `cos4`) times 1 + a theta^2 + b
/// theta^4 + c theta^6.
struct Vignetting {
    bool cos4 = false;
    std::array<double, 3> polynomial{};  ///< a, b, c
};
[[nodiscard]] std::shared_ptr<const OpticalEffect> vignetting(const Vignetting& v);

extern const OpticsKind kVignetting;

}  // namespace narpa
