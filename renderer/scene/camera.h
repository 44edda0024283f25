/// renderer/scene/camera.h - a camera of a scene: its mount, projection, optics, detector and timing.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/pixel_format.h"
#include "base/pose.h"
#include "protocols/camera_control.h"
#include "renderer/detector/detector_settings.h"
#include "renderer/projection/pinhole.h"
#include "renderer/scene/course.h"

namespace narpa {

/// Thin lens: a point off the focus distance, at depth z, is blurred to a circle of aperture * fx * |1/focus - 1/z|
/// pixels.
struct Lens {
    double aperture_diameter_m = 0;
    double focus_distance_m = 0;  ///< from the lens, along z; infinite is allowed
};

/// When the rows of an image are exposed. Without it every frame shows one instant, mid-exposure.
struct Shutter {
    std::int64_t row_time_ns = 0;  ///< from the start of one row's exposure to the next one's; 0: a global shutter
};

/// A camera that is operated over CAN while it runs: protocols/camera_control.h.
struct CameraControlLimits {
    std::int64_t latency_ns = 10'000'000;             ///< from a command to the first exposure that it may act on
    TriggerMode trigger = TriggerMode::free_running;  ///< at the start
    std::int64_t exposure_min_ns = 10'000, exposure_max_ns = 0;
    std::int16_t gain_max_cdb = 2400;
    bool auto_exposure = false;  ///< at the start
    double level = 0.3;          ///< target of auto-exposure: mean of the image, share of full scale
};

/// Largest reach of the filter of a point spread function, pixels.
inline constexpr int kPointSpreadReach_px = 31;

/// Point spread function of a lens as samples that sum to 1, row by row.
struct PointSpreadImage {
    int width = 0, height = 0;
    double centre_x = 0, centre_y = 0;  ///< where a pinhole images the point; the first sample is at (0, 0)
    std::vector<double> samples;
};

/// The blur of the lens, the same all over the image; renderer/optics/point_spread.h.
struct PointSpreadFunction {
    double sigma_px = 0;       ///< of a Gaussian; 0: none
    double cutoff_per_px = 0;  ///< diffraction: pixel pitch / (wavelength * f-number); 0: none
    std::shared_ptr<const PointSpreadImage> image{};
    double samples_per_px = 1;  ///< of the image
};

/// Lens ghost: an image of the aperture in the Sun's light, by two reflections in the lens;
/// renderer/optics/sun_ghost.h.
struct Ghost {
    double strength = 0;  ///< share of the Sun's light that enters the aperture
    double radius_px = 1;
    double scale = 1;       ///< distance from the principal point over that of the Sun's image, on the other side
    double within_rad = 0;  ///< angle of the Sun from the optical axis, below a right angle
};

/// The share of light at theta radians from the optical axis: cos^4 theta (if `cos4`) times 1 + a theta^2 + b
/// theta^4 + c theta^6.
struct Vignetting {
    bool cos4 = false;
    std::array<double, 3> polynomial{};  ///< a, b, c
};

enum class LatePolicy : std::uint8_t { drop, repeat, late, blank };

struct Camera {
    std::string name;
    int mount = -1;  ///< body it rides on; -1 is the world
    Rigid3 T_mount_camera{};
    std::shared_ptr<const Course> course{};  ///< of a camera on the world that moves; T_mount_camera: at time 0
    int width = 640, height = 480;
    std::shared_ptr<const CameraModel> model{};  ///< its projection; never null in a scene that was read
    std::int64_t period_ns = 100'000'000;        ///< 1 / rate_hz
    PixelFormat format = PixelFormat::grey;
    bool embedded_line = false;  ///< the last row carries the frame's identity and ledger
    LatePolicy late = LatePolicy::late;
    double white_radiance = 0;         ///< radiance that an ideal sensor maps to full scale, W m^-2 sr^-1
    std::optional<Detector> detector;  ///< none: an ideal sensor without noise (see white_radiance)
    std::optional<Shutter> shutter{};
    std::optional<CameraControlLimits> control{};
    std::optional<Lens> lens{};  ///< none: a pinhole
    std::optional<PointSpreadFunction> point_spread{};
    std::optional<Vignetting> vignetting{};
    double veiling_glare = 0;  ///< share of the light that is spread evenly over the image
    std::optional<Ghost> ghost{};

    /// Valid while the camera stays as it is.
    operator ImageSensor() const noexcept {  // NOLINT(google-explicit-constructor)
        return {name, width, height, format, white_radiance, detector ? &*detector : nullptr};
    }
};

}  // namespace narpa
