/// renderer/optics/sun_ghost.h - the ghost of the Sun: its light after two reflections between surfaces of the
/// lens.
///
/// To first order in the angle from the optical axis, the centre of such a ghost is proportional to the position of
/// the Sun's image relative to the principal point, and the ghost is an image of the lens's aperture at a constant
/// size (S. Lee and E. Eisemann, "Practical Real-Time Lens-Flare Rendering", 2013; R. Abd El-Maksoud and J. Sasian,
/// "Paraxial ghost image analysis", Proc. SPIE 7428, 2009). It has the entering light times the product of the two
/// reflectances: 1.6e-3 for bare glass, 2.5e-5 for coatings that reflect 0.5 %.
#pragma once

#include "renderer/optics/optical_effect.h"

namespace narpa {

struct Ghost {
    double strength = 0;  ///< share of the Sun's light that enters the aperture
    double radius_px = 1;
    double scale = 1;       ///< distance from the principal point over that of the Sun's image, on the other side
    double within_rad = 0;  ///< angle of the Sun from the optical axis, below a right angle
};
/// Adds a uniform disc to the image, unless the Sun is outside the ghost's angle or a body occludes its centre at
/// mid-exposure. Its pixels' radiance makes the detector collect `strength` times the Sun's light through the
/// aperture, irradiance * cos(angle from the axis), fading over the last tenth of the ghost's angle and attenuated
/// by the scene's medium. Each row shows the disc at the middle of the row's exposure. The light is accurate to
/// 0.5 % for a radius of 5 px or more, to 4 % at 1 px.
[[nodiscard]] std::shared_ptr<const OpticalEffect> sun_ghost(const Ghost& ghost);

extern const OpticsKind kSunGhost;

}  // namespace narpa
