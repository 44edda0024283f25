/// renderer/atmosphere/panel_scattering.h - light that the air scatters into a ray, panel by panel.
#pragma once

#include "renderer/atmosphere/air_tables.h"

namespace narpa {

/// A ray relative to the planet and the Sun.
struct AirRay {
    float radius_m;                ///< of its start
    float up, sun_cosine, sun_nu;  ///< there: cosines of ray and zenith, Sun and zenith, ray and Sun
    bool exact;                    ///< the aerosol's own phase function, for light scattered once
};

/// Transmittance from the ray's start to the panel's nodes.
void attenuate(const Air& air, const AirPanel& p, PanelTransmittance& through) noexcept;
/// Adds sunlight scattered into the ray on a panel.
void add_once(const AirTables& t, const Air& air, const AirPanel& p, const PanelTransmittance& through,
              const AirRay& ray, Air::Spectrum& out) noexcept;
/// Adds light of the table scattered into the ray on a panel.
void add_again(const AirTables& t, const Air& air, const AirPanel& p, const PanelTransmittance& through,
               const AirRay& ray, Air::Spectrum& out) noexcept;

}  // namespace narpa
