/// renderer/integrator/sun_direct_lighting.h - Sun-only direct lighting, sixteen lanes at once.
///
/// Most frames of method "direct" show Lambert's and Phong's materials in the light of the Sun alone. These are
/// shaded by vector instructions, material by material, with one batch of shadow rays; other materials lane by
/// lane.
#pragma once

#include "renderer/integrator/integrator.h"

namespace narpa {

class SunDirectLighting final : public Integrator {
public:
    /// True where the Sun, a uniform background and the emission of visible surfaces are all the light, and there
    /// is no medium.
    [[nodiscard]] static bool suffices(const RenderScene& render_scene) noexcept;

    void radiance(const Frame& f, Packet& packet, RgbLanes& radiance) const noexcept override;
    void radiance(const Frame& f, std::span<Packet> packets, std::span<PacketLight> light) const noexcept override;
};

/// For PathIntegrator: emission and direct sunlight of the lanes that meet flat faces of Lambert's and Phong's
/// materials without too sharp a lobe. Sets Packet::first and Packet::lit.
void light_first_surfaces(const Frame& f, Packet& p, RgbLanes& radiance) noexcept;

}  // namespace narpa
