/// renderer/scene/atmosphere_settings.h - [atmosphere] of a scene.
#pragma once

#include "renderer/atmosphere/air_description.h"

namespace narpa {

/// A planet's air.
struct Atmosphere {
    int body = 0;  ///< the planet
    AirDescription air;
    int samples_per_band = 2;  ///< wavelengths that stand for a band
    int steps = 12;            ///< quadrature nodes of a part of a ray
};

}  // namespace narpa
