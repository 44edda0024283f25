/// renderer/detector/cosmic_rays.h - the charge that fast charged particles leave in the silicon of a detector.
///
/// Particles are minimum-ionising, come from everywhere alike, cross the sensitive layer in a straight line and
/// release 73 electrons a micrometre: 22,000 in 300 um, the most probable charge (Particle Data Group, Review of
/// Particle Physics, "Particle detectors at accelerators", silicon semiconductor detectors). The spread about it
/// (Landau), secondary electrons and diffusion are left out.
#pragma once

#include <cstdint>
#include <span>

#include "base/counter_random.h"
#include "renderer/scene/scene.h"

namespace narpa {

inline constexpr double kCosmicRayElectrons_per_m = 73e6;

/// Mean number on the sensor in one exposure: rate * area * exposure time, at most one per pixel.
[[nodiscard]] double mean_cosmic_rays(const Camera& camera) noexcept;

/// Adds the charge of a frame's hits to one band's photosites, row-major, `camera.height` x `camera.width`. The
/// number of hits is Poisson; their places are uniform; the zenith angle of particles that cross a plane has P(cos
/// < c) = c^2. The camera must have a detector.
void add_cosmic_rays(const Camera& camera, const PhiloxSchedule& random, std::uint32_t frame, std::uint32_t band,
                     std::span<float> charge_e) noexcept;

}  // namespace narpa
