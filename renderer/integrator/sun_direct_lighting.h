/// renderer/integrator/sun_direct_lighting.h - direct sunlight, sixteen lanes at once.
///
/// Most frames of method "direct" show Lambert's and Phong's materials lit only by the Sun. These are shaded with
/// vector instructions, material by material, with one batch of shadow rays; other materials are shaded lane by
/// lane.
#pragma once

#include "renderer/integrator/integrator.h"

namespace narpa {

/// Method "direct" where the Sun is the only light.
class SunDirectLighting final : public Integrator {
public:
    /// True if the Sun, a uniform background and the emission of visible surfaces are the only light, and there is
    /// no medium.
    [[nodiscard]] static bool suffices(const RenderScene& render_scene) noexcept;

    [[nodiscard]] LightParts parts() const noexcept override { return LightParts::direct; }
    void radiance(const Transport& t, TracedRays& batch, RgbLanes& radiance) const noexcept override;
    void radiance(const Transport& t, std::span<TracedRays> batches,
                  std::span<BatchRadiance> light) const noexcept override;
};

/// Adds emission and direct sunlight in lanes that hit flat faces of Lambert's material, or of Phong's unless its
/// lobe is too sharp. Sets TracedRays::first and TracedRays::lit.
void add_first_hit_sunlight(const Transport& t, TracedRays& p, RgbLanes& radiance) noexcept;

}  // namespace narpa
