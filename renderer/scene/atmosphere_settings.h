/// renderer/scene/atmosphere_settings.h - [atmosphere] and [sky] of a scene.
#pragma once

#include "base/vec3.h"
#include "renderer/atmosphere/air_description.h"

namespace narpa {

/// A planet's air.
struct Atmosphere {
    int body = 0;  ///< the planet
    AirDescription air;
    int samples_per_band = 2;  ///< wavelengths that stand for a band
    int steps = 12;            ///< quadrature nodes of a part of a ray
};

/// Hosek and Wilkie's clear sky, seen from flat ground.
struct AnalyticSky {
    Vec3 up{0, 0, 1};  ///< world
    double turbidity = 3;
    double ground_albedo = 0.1;
};

}  // namespace narpa
