/// renderer/integrator/path_integrator.h - the integrators over the wavefront kernel.
#pragma once

#include "renderer/integrator/integrator.h"

namespace narpa {

/// Method "direct" in any scene (PathSettings::direct).
class DirectIntegrator final : public Integrator {
public:
    void radiance(const Frame& f, Packet& packet, RgbLanes& radiance) const noexcept override;
    void radiance(const Frame& f, std::span<Packet> packets, std::span<PacketLight> light) const noexcept override;
};

/// Method "path": all light. Many batches together with path reuse, and, where the Sun alone emits, with the direct
/// light of first surfaces by SunDirectLighting. Paths then bring the rest, from fewer of the samples: at equal
/// error 9 % less time with 16 samples a pixel and 25 % with 64, on the craft by paths of four vertices.
class PathIntegrator final : public Integrator {
public:
    void radiance(const Frame& f, Packet& packet, RgbLanes& radiance) const noexcept override;
    void radiance(const Frame& f, std::span<Packet> packets, std::span<PacketLight> light) const noexcept override;
};

}  // namespace narpa
