/// renderer/camera/star_light.h - the stars of a scene in a camera's image.
///
/// A star is a point at infinity. Its irradiance E in a band gives the pixels that its image covers E * (px^2 per
/// sr) of radiance in all, through the point response of lens and pixel, so that the detector collects the light of
/// its whole aperture. Within an exposure its image is a polyline, of which each row takes the part that falls into
/// its own exposure.
#pragma once

#include <vector>

#include "renderer/camera/camera_pose.h"
#include "renderer/camera/image_optics.h"
#include "renderer/camera/point_response.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/light/medium.h"

namespace narpa {

/// In the renderer's bands (solar_bands.h), W m^-2: the Sun's 1361 W m^-2 at V = -26.76, of the colour of a
/// blackbody whose temperature follows from B - V (F. J. Ballesteros, "New insights into black bodies", EPL 97,
/// 2012), with the magnitude kept in the green band.
[[nodiscard]] Rgb star_irradiance(double v_magnitude, double b_v) noexcept;

/// Apparent direction (unit) of a source at `direction` (unit) for an observer who moves at `velocity_m_s`, in the
/// same axes: special relativity's aberration, exact.
[[nodiscard]] Vec3 aberrated(const Vec3& direction, const Vec3& velocity_m_s) noexcept;

class StarLight {
public:
    /// The scene has stars; it and the camera outlive this. Allocates all memory.
    StarLight(const Scene& scene, const Camera& camera);

    /// Adds the stars that no body hides to an image that has its point spread already. `optics`: of the same
    /// camera. Hidden is decided by rays from the lens's centre, one for each pixel that a star's image passes;
    /// along the same rays `medium`, which may be null, dims them. Same bytes on any number of threads; runs on the
    /// calling thread's TBB arena; allocates nothing.
    void add(const Tracer& tracer, const Medium* medium, const BodyPoses& at, const CameraPose& pose,
             const ImageOptics& optics, RadianceImage& image) noexcept;

private:
    /// The straight part of a trail between two moments; the whole image of a star where there is one only.
    struct Segment {
        Vec3 direction{};           ///< at its middle, unit, camera axes
        double start = 0, end = 1;  ///< fractions of the exposure
        ImagePoint from{}, to{};
        Rgb light{};  ///< radiance summed over the pixels, had it shone there during the whole exposure
        bool hidden = false;
    };
    struct Moment {
        Quat q_camera_icrs{};
        double time = kMidExposure;
    };
    struct Frame {
        const Tracer& tracer;
        const Medium* medium;
        const BodyPoses& at;
        const CameraPose& pose;
        const ImageOptics& optics;
        RadianceImage& image;
    };

    /// Returns the angle by which the camera turns among the stars within the exposure.
    double set_moments(const BodyPoses& at, const CameraPose& pose) noexcept;
    void add_trail(const Vec3& direction, const Rgb& irradiance, const Frame& f) noexcept;
    /// False too where it is a few images long, which takes turns of thousands of images in one exposure: its light
    /// is too thin to be seen.
    [[nodiscard]] bool reaches_image(const Segment& s) const noexcept;
    /// Traces and draws what is in the buffer.
    void flush(const Frame& f) noexcept;
    void trace(const Frame& f, std::size_t first) noexcept;
    void draw_row(const Segment& s, const CameraPose& pose, int y, Rgb* row) const noexcept;

    const Camera& camera_;
    const StarField& field_;
    CameraModelHandle model_;
    PointResponse response_;
    double points_per_px_;         ///< along a trail
    DirectionCone view_;           ///< of the image and what lies within the response's reach, camera axes
    double px_per_rad_ = 0;        ///< by which a star's image moves at most
    std::vector<Rgb> irradiance_;  ///< of each star
    std::vector<Moment> moments_;  ///< the ends of the segments
    std::size_t segments_ = 1;     ///< of each trail in this frame
    std::vector<Segment> buffer_;
    std::size_t buffered_ = 0;
};

}  // namespace narpa
