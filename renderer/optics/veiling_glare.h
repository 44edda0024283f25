/// renderer/optics/veiling_glare.h - light that the optics scatter evenly over the image.
#pragma once

#include "renderer/optics/optical_effect.h"

namespace narpa {

/// `share` of the light of the whole image, stars included.
[[nodiscard]] std::shared_ptr<const OpticalEffect> veiling_glare(double share);

extern const OpticsKind kVeilingGlare;

}  // namespace narpa
