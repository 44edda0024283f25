/// renderer/atmosphere/panel_scattering.h - light that the air scatters into a ray, panel by panel.
#pragma once

#include "renderer/atmosphere/air_tables.h"

namespace narpa {

/// A ray relative to the planet and the Sun.
struct AirRay {
    float radius_m;                ///< of its start
    float up, sun_cosine, sun_nu;  ///< there: cosines of ray and zenith, Sun and zenith, ray and Sun
};

/// The aerosol's scattering of sunlight into a ray: what is kept of its phase function when that is cut off at
/// kMaxDegree, and the forward peak. Light that the peak has scattered n times has the peak folded n times.
struct AerosolPhase {
    static constexpr std::size_t kMostFolds = 5;
    Air::Spectrum rest{};  ///< times scattering, 1/m
    bool exact = false;    ///< with the peak; else it counts as no scattering
    Air::Spectrum peak{};  ///< its scattering, 1/m
    std::array<Air::Spectrum, kMostFolds> folded{};
};
/// `sun_nu`: cosine of ray and Sun.
void set_phase(const Air& air, float sun_nu, bool exact, AerosolPhase& phase) noexcept;

/// Transmittance from the ray's start to the panel's nodes.
void attenuate(const Air& air, const AirPanel& p, PanelTransmittance& through) noexcept;
/// Adds sunlight scattered into the ray on a panel.
void add_once(const AirTables& t, const Air& air, const AirPanel& p, const PanelTransmittance& through,
              const AirRay& ray, const AerosolPhase& phase, Air::Spectrum& out) noexcept;
/// Adds light of the table scattered into the ray on a panel.
void add_again(const AirTables& t, const Air& air, const AirPanel& p, const PanelTransmittance& through,
               const AirRay& ray, Air::Spectrum& out) noexcept;

}  // namespace narpa
