/// renderer/atmosphere/scattering/panel_scattering.h - light that the air scatters into a ray, panel by panel.
#pragma once

#include "renderer/atmosphere/air_tables.h"

namespace narpa {

/// A ray relative to the planet and the Sun.
struct AirRay {
    float radius_m;                ///< of its start
    float up, sun_cosine, sun_nu;  ///< cosines at the start: ray and zenith, Sun and zenith, ray and Sun
};

/// The aerosol's scattering of sunlight into a ray: the phase function truncated at kMaxDegree, and the forward
/// peak. For light that the peak has scattered n times, the peak is convolved n times with itself.
struct AerosolPhase {
    static constexpr std::size_t kMaxFolds = 5;
    Air::Spectrum rest{};  ///< truncated phase function times scattering coefficient, 1/(m sr)
    bool exact = false;    ///< includes the peak; else the peak counts as unscattered light
    Air::Spectrum peak{};  ///< scattering coefficient of the peak, 1/m
    std::array<Air::Spectrum, kMaxFolds> folded{};
};
/// `sun_nu`: cosine of ray and Sun.
void set_phase(const Air& air, float sun_nu, bool exact, AerosolPhase& phase) noexcept;

/// Transmittance from the ray's start to the panel's nodes.
void attenuate(const Air& air, const AirPanel& p, PanelTransmittance& through) noexcept;
/// Adds single scattering: sunlight scattered into the ray on a panel.
void add_single_scattering(const AirTables& t, const Air& air, const AirPanel& p, const PanelTransmittance& through,
                           const AirRay& ray, const AerosolPhase& phase, Air::Spectrum& out) noexcept;
/// Adds multiple scattering: the table's light scattered into the ray on a panel.
void add_multiple_scattering(const AirTables& t, const Air& air, const AirPanel& p,
                             const PanelTransmittance& through, const AirRay& ray, Air::Spectrum& out) noexcept;

}  // namespace narpa
