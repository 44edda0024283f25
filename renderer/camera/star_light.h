/// renderer/camera/star_light.h - the stars of a scene in a camera's image.
///
/// A star is a point at infinity. With irradiance E in a band, the radiances of the pixels that its image covers
/// sum to E * (px^2 per sr), distributed by the point response of lens and pixel, so that the detector collects the
/// light of its whole aperture. During an exposure its image is a polyline; each row receives the part that falls
/// into its own exposure.
#pragma once

#include <vector>

#include "base/camera_pose.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/light/medium.h"
#include "renderer/optics/image_optics.h"
#include "renderer/optics/point_response.h"

namespace narpa {

/// Irradiance in the renderer's bands (solar_bands.h), W m^-2: the Sun's 1361 W m^-2 at V = -26.76 sets the scale,
/// kept in the green band; the colour is that of a blackbody whose temperature follows from B - V (F. J.
/// Ballesteros, "New insights into black bodies", EPL 97, 2012).
[[nodiscard]] Rgb star_irradiance(double v_magnitude, double b_v) noexcept;

/// Apparent direction (unit) of a source at `direction` (unit) for an observer who moves at `velocity_m_s`, in the
/// same axes: exact relativistic aberration.
[[nodiscard]] Vec3 aberrated(const Vec3& direction, const Vec3& velocity_m_s) noexcept;

class StarLight {
public:
    /// The scene has stars; it and the camera outlive this. Allocates all memory.
    StarLight(const Scene& scene, const Camera& camera);

    /// Adds the stars that no body occludes to an image after its point spread. `optics`: of the same camera.
    /// Occlusion is tested by rays from the lens's centre, one for each pixel that a star's image passes; `medium`,
    /// which may be null, attenuates the stars along the same rays. Same bytes on any number of threads; runs on
    /// the calling thread's TBB arena; allocates nothing.
    void add(const Tracer& tracer, const Medium* medium, const BodyPoses& at, const CameraPose& pose,
             const ImageOptics& optics, RadianceImage& image) noexcept;

private:
    /// The straight part of a trail between two moments; the whole image of a star if there is only one moment.
    struct Segment {
        Vec3 direction{};           ///< at its middle, unit, camera axes
        double start = 0, end = 1;  ///< fractions of the exposure
        ImagePoint from{}, to{};
        Rgb light{};  ///< radiance summed over the pixels, as if it shone there during the whole exposure
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
    /// Also false for a segment several images long, which takes thousands of images per exposure: its light is too
    /// faint to be seen.
    [[nodiscard]] bool reaches_image(const Segment& s) const noexcept;
    /// Traces and draws what is in the buffer.
    void flush(const Frame& f) noexcept;
    void trace(const Frame& f, std::size_t first) noexcept;
    void draw_row(const Segment& s, const CameraPose& pose, int y, Rgb* row) const noexcept;

    const Camera& camera_;
    const StarField& field_;
    std::shared_ptr<const CameraModel> model_;
    PointResponse response_;
    double points_per_px_;         ///< along a trail
    DirectionCone view_;           ///< cone of the image extended by the response's reach, camera axes
    double px_per_rad_ = 0;        ///< largest motion of a star's image per angle
    std::vector<Rgb> irradiance_;  ///< of each star
    std::vector<Moment> moments_;  ///< the ends of the segments
    std::size_t segments_ = 1;     ///< of each trail in this frame
    std::vector<Segment> buffer_;
    std::size_t buffered_ = 0;
};

}  // namespace narpa
