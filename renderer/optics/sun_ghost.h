/// renderer/optics/sun_ghost.h - the ghost of the Sun: its light after two reflections between surfaces of the
/// lens.
///
/// To first order in the angle from the optical axis, the centre of such a ghost is proportional to the position of
/// the Sun's image relative to the principal point, and the ghost is an image of the lens's aperture at a constant
/// size (S. Lee and E. Eisemann, "Practical Real-Time Lens-Flare Rendering", 2013; R. Abd El-Maksoud and J. Sasian,
/// "Paraxial ghost image analysis", Proc. SPIE 7428, 2009). It has the entering light times the product of the two
/// reflectances: 1.6e-3 for bare glass, 2.5e-5 for coatings that reflect 0.5 %.
#pragma once

#include <memory>
#include <optional>

#include "base/camera_pose.h"
#include "base/radiance_image.h"
#include "renderer/geometry/tracer.h"
#include "renderer/light/medium.h"
#include "renderer/scene/scene.h"

namespace narpa {

class SunGhost {
public:
    /// Null if the camera has no ghost or the scene no Sun.
    static std::unique_ptr<const SunGhost> create(const Scene& scene, const Camera& camera);
    SunGhost(const Sun& sun, const Ghost& ghost, const Camera& camera);

    /// Adds a uniform disc to the image, unless the Sun is outside the ghost's angle or a body occludes its centre
    /// at mid-exposure. Its pixels' radiance makes the detector collect `strength` times the Sun's light through
    /// the aperture, irradiance * cos(angle from the axis), fading over the last tenth of the ghost's angle and
    /// attenuated by `medium`, which may be null. Each row shows the disc at the middle of the row's exposure. The
    /// light is accurate to 0.5 % for a radius of 5 px or more, to 4 % at 1 px. Allocates nothing.
    void add(const Tracer& tracer, const Medium* medium, const BodyPoses& at, const CameraPose& pose,
             RadianceImage& image) const noexcept;

private:
    [[nodiscard]] std::optional<ImagePoint> centre(const Rigid3& T_world_camera) const noexcept;
    [[nodiscard]] double share_within_hood(double angle_rad) const noexcept;
    void add_row(const ImagePoint& centre, const Rgb& radiance, int y, RadianceImage& image) const noexcept;

    Sun sun_;
    Ghost ghost_;
    std::shared_ptr<const CameraModel> model_;
    ImagePoint principal_;
};

}  // namespace narpa
