/// renderer/detector/cosmic_rays.h - the charge that fast charged particles leave in the silicon of a detector.
///
/// Particles are minimum-ionising, come from everywhere alike, cross the sensitive layer in a straight line and
/// release 73 electrons a micrometre: 22,000 in 300 um, the most probable charge (Particle Data Group, Review of
/// Particle Physics, "Particle detectors at accelerators", silicon semiconductor detectors). The spread about it
/// (Landau), secondary electrons and diffusion are left out.
#pragma once

#include "renderer/detector/detector_stage.h"

namespace narpa {

inline constexpr double kCosmicRayElectrons_per_m = 73e6;

struct CosmicRays {
    double per_cm2_s = 0;
    double sensitive_depth_m = 1e-5;  ///< of the silicon that collects their charge
};
/// Adds the charge of a frame's hits. The number of hits is Poisson; their places are uniform; the zenith angle of
/// particles that cross a plane has P(cos < c) = c^2.
[[nodiscard]] std::shared_ptr<const DetectorStage> cosmic_rays(const CosmicRays& rays);

/// Mean number on the sensor in one exposure: rate * area * exposure time, at most one per pixel.
[[nodiscard]] double mean_cosmic_rays(const CosmicRays& rays, const ImageSensor& sensor) noexcept;

extern const DetectorStageKind kCosmicRays;

}  // namespace narpa
