/// renderer/camera/sun_ghost.h - the ghost of the Sun: its light after two reflections between surfaces of the
/// lens.
///
/// To first order of the angle from the optical axis, the centre of such a ghost is proportional to that of the
/// Sun's image, about the principal point, and the ghost is the lens's aperture at a constant size (S. Lee and E.
/// Eisemann, "Practical Real-Time Lens-Flare Rendering", 2013; R. Abd El-Maksoud and J. Sasian, "Paraxial ghost
/// image analysis", Proc. SPIE 7428, 2009). It has the product of the two reflectances of the light that
/// enters: 1.6e-3 for bare glass, 2.5e-5 for coatings that reflect 0.5 %.
#pragma once

#include <memory>
#include <optional>

#include "renderer/camera/camera_pose.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/tracer.h"
#include "renderer/image/radiance_image.h"
#include "renderer/light/medium.h"

namespace narpa {

class SunGhost {
public:
    /// Null where the camera has no ghost or the scene no Sun.
    static std::unique_ptr<const SunGhost> create(const Scene& scene, const Camera& camera);
    SunGhost(const Sun& sun, const Ghost& ghost, const Camera& camera);

    /// Adds an evenly lit disc to the image, unless the Sun is outside the ghost's angle or a body hides its centre
    /// at mid-exposure. The radiance of its pixels is that with which the detector collects `strength` of the Sun's
    /// light through the aperture, irradiance * cos(angle from the axis), less over the last tenth of the ghost's
    /// angle and as much less as `medium`, which may be null, dims the Sun. Each row has the disc where it is in
    /// the middle of the row's exposure. Its light is right within 0.5 % from a radius of 5 px on, 4 % at 1 px.
    /// Allocates nothing.
    void add(const Tracer& tracer, const Medium* medium, const BodyPoses& at, const CameraPose& pose,
             RadianceImage& image) const noexcept;

private:
    [[nodiscard]] std::optional<ImagePoint> centre(const Rigid3& T_world_camera) const noexcept;
    [[nodiscard]] double share_within_hood(double angle_rad) const noexcept;
    void add_row(const ImagePoint& centre, const Rgb& radiance, int y, RadianceImage& image) const noexcept;

    Sun sun_;
    Ghost ghost_;
    CameraModelHandle model_;
    ImagePoint principal_;
};

}  // namespace narpa
