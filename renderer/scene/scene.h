/// renderer/scene/scene.h - bodies, lights, sensors and settings as plain data: the result of reading a scene file.
///
/// SI units; world frame right-handed and inertial. Features that a scene file does not name are absent (empty
/// vector, empty optional) and cost nothing; this is decided once, before the first frame.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/pixel_format.h"
#include "base/pose.h"
#include "base/vec3.h"
#include "protocols/camera_control.h"
#include "renderer/material/material.h"
#include "renderer/projection/distortion.h"
#include "renderer/scene/atmosphere_settings.h"
#include "renderer/scene/course.h"

namespace narpa {

class LidarModel;

/// Triangles in the body's own frame, metres. Degenerate and non-finite ones were dropped when it was read.
struct Mesh {
    std::string name;
    std::vector<Vec3f> positions;
    std::vector<Vec3f> normals;                       ///< per vertex, or empty: flat shading
    std::vector<std::array<float, 2>> uvs;            ///< per vertex, or empty; v up, (0, 0) is the bottom left
    std::vector<std::array<std::uint32_t, 3>> faces;  ///< counter-clockwise seen from outside
    std::vector<std::uint16_t> face_material;         ///< per face, index into Scene::materials
    Vec3 origin_m{};                                  ///< of the positions, in the body's frame
    bool height_field = false;                        ///< a terrain: counts as open, whatever its edges
};

struct Sphere {
    double radius_m = 1;
    int material = 0;  ///< index into Scene::materials
};

/// (x/a)^2 + (y/b)^2 + (z/c)^2 = 1 in the body's frame.
struct Ellipsoid {
    Vec3 semi_axes_m{1, 1, 1};
    int material = 0;  ///< index into Scene::materials
};

struct Body {
    std::string name;
    std::variant<int, Sphere, Ellipsoid> shape;  ///< index into Scene::meshes, or an exact shape
    Motion initial{};                            ///< at time 0
    std::shared_ptr<const Course> course{};      ///< null: constant velocity and rate from `initial`
    std::optional<std::uint32_t> can_id{};       ///< base identifier of its pose commands on CAN
};

/// Motion of a body without commands.
[[nodiscard]] inline Motion motion_at(const Body& body, double t_s) {
    return body.course ? body.course->at(t_s) : extrapolate(body.initial, t_s);
}

struct Sun {
    Vec3 direction{0, 0, 1};  ///< unit, world: from the scene towards the Sun
    double irradiance_w_m2 = 1361.0;
    double angular_diameter_rad = 0.533 * 3.14159265358979323846 / 180.0;
};

/// A point of light at infinity.
struct Star {
    Vec3 direction{};  ///< unit, ICRS, as seen from the solar system's barycentre at the scene's epoch
    double v_magnitude = 0, b_v = 0.65;  ///< Johnson V and B - V
};

/// The stars in the background, and the attitude and velocity of the world frame among them.
struct StarField {
    std::vector<Star> stars;
    Quat q_icrs_world{};  ///< at simulation time 0
    Vec3 rate_rad_s{};    ///< of the world frame in ICRS, world axes
    Vec3 velocity_m_s{};  ///< of the world frame's origin from the barycentre, world axes: for aberration
    /// At a simulation time.
    [[nodiscard]] Quat q_icrs_world_at(double t_s) const { return q_icrs_world * exp_rotation(t_s * rate_rad_s); }
};

/// A lamp or any other source that is not a body's surface. In its own frame it shines along +z.
struct Light {
    enum class Kind : std::uint8_t {
        point,        ///< emission is the radiant intensity, W sr^-1 a band, the same in all directions
        directional,  ///< emission is the irradiance on a surface that faces it, W m^-2 a band
        rectangle,    ///< emission is the radiance of its +z side, W m^-2 sr^-1 a band; seen by cameras and mirrors
        disc,         ///< the same
    };
    std::string name;
    Kind kind = Kind::point;
    int mount = -1;  ///< body it rides on; -1 is the world
    Rigid3 T_mount_light{};
    Rgb emission{};
    double width_m = 1, height_m = 1;  ///< rectangle: along its x and y, centred
    double radius_m = 0.5;             ///< disc
};

/// Photons to digital numbers. Absent: an ideal sensor without noise (see Camera::white_radiance). Amounts of 0 and
/// switches that are false are exactly off.
struct Detector {
    double exposure_s = 0.01;  ///< exposure stops included
    double pixel_pitch_m = 5e-6;
    double f_number = 4;
    double quantum_efficiency = 0.5;  ///< electrons per photon
    double full_well_e = 20000;
    double gain_e_per_dn = 0;  ///< 0: full_well_e / (2^bits - 1 - black_level_dn)
    double read_noise_e = 0;   ///< RMS
    bool shot_noise = false;   ///< Poisson
    int black_level_dn = 0;
    int bits = 12;  ///< ADC, 8..16

    double dark_current_e_s = 0;  ///< mean of a pixel, at dark_reference_c
    double temperature_c = 20, dark_reference_c = 20;
    double dark_doubling_c = 7;  ///< temperature step, K, that doubles the dark current
    double prnu = 0;             ///< relative standard deviation of the pixels' gains: EMVA's PRNU_1288
    double dsnu_e = 0;           ///< standard deviation of the pixels' offsets: EMVA's DSNU_1288
    double dead_pixel_share = 0;
    double hot_pixel_share = 0, hot_pixel_e_s = 0;      ///< dark current added, at dark_reference_c
    double blinking_pixel_share = 0, blinking_e_s = 0;  ///< the same, in half of the frames
    bool blooming = false;
    double cosmic_rays_per_cm2_s = 0;
    double sensitive_depth_m = 1e-5;  ///< of the silicon that collects a cosmic ray's charge
};

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

/// The blur of the lens, the same all over the image; renderer/camera/point_spread.h.
struct PointSpreadFunction {
    double sigma_px = 0;       ///< of a Gaussian; 0: none
    double cutoff_per_px = 0;  ///< diffraction: pixel pitch / (wavelength * f-number); 0: none
    std::shared_ptr<const PointSpreadImage> image{};
    double samples_per_px = 1;  ///< of the image
};

/// Lens ghost: an image of the aperture in the Sun's light, by two reflections in the lens;
/// renderer/camera/sun_ghost.h.
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
    double fx = 0, fy = 0, cx = 0, cy = 0;  ///< px; the centre of the top-left pixel is (0, 0)
    std::optional<Distortion> distortion{};
    std::shared_ptr<const CameraModel> model{};  ///< null: the pinhole of the above
    std::int64_t period_ns = 100'000'000;        ///< 1 / rate_hz
    PixelFormat format = PixelFormat::grey;
    bool embedded_line = false;  ///< the last row carries the frame's identity and ledger
    LatePolicy late = LatePolicy::late;
    double white_radiance = 0;  ///< radiance that an ideal sensor maps to full scale, W m^-2 sr^-1
    std::optional<Detector> detector;
    std::optional<Shutter> shutter{};
    std::optional<CameraControlLimits> control{};
    std::optional<Lens> lens{};  ///< none: a pinhole
    std::optional<PointSpreadFunction> point_spread{};
    std::optional<Vignetting> vignetting{};
    double veiling_glare = 0;  ///< share of the light that is spread evenly over the image
    std::optional<Ghost> ghost{};
};

/// Model of a LiDAR's receiver. With the default values it reports the exact range along the beam's axis, always
/// detected. Strengths of echoes are relative to the detection threshold.
struct LidarReceiverModel {
    double beam_divergence_rad = 0;  ///< full angle of the evenly lit cone of the beam
    int sub_rays = 1;                ///< number of rays that sample the cone: 1, or kMinSubRays to kMaxSubRays
    double pulse_length_m = 0.9;     ///< surfaces closer in range than this make one echo: c / 2 * duration
    enum class Multipath : std::uint8_t {
        none,
        mirrors,  ///< a beam goes on from mirrors
        diffuse,  ///< as mirrors, and light from one surface to another
    };
    Multipath multipath = Multipath::none;

    double range_min_m = 0;            ///< echoes from nearer are lost
    double range_at_10_percent_m = 0;  ///< where a surface of 10 %, across the beam, is just detected; 0: no limit
    double detection_snr = 0;          ///< of an echo at the threshold, detected half of the time; 0: a sharp limit
    double sunlight_noise = 0;  ///< noise variance added by a white surface in full sunlight, over that in the dark

    double range_bias_m = 0;
    double range_noise_m = 0;           ///< standard deviation
    double range_noise_at_limit_m = 0;  ///< the same at the threshold; proportional to 1 / strength
    double range_walk_m = 0;            ///< range error at the threshold; proportional to 1 / strength
    double range_ambiguity_m = 0;       ///< ranges are modulo this, c / 2 * time between pulses; 0: they are not
    double velocity_noise_m_s = 0;      ///< standard deviation
    double velocity_ambiguity_m_s = 0;  ///< velocities are modulo this, about 0; 0: they are not

    static constexpr int kMinSubRays = 8, kMaxSubRays = 64;
    friend bool operator==(const LidarReceiverModel&, const LidarReceiverModel&) = default;
};

struct Lidar {
    std::string name;
    int mount = -1;
    Rigid3 T_mount_lidar{};                   ///< lidar frame: x right, y forward, z up
    std::shared_ptr<const LidarModel> model;  ///< never null in a scene that was read
    double range_max_m = 100;                 ///< returns beyond are not reported
    LidarReceiverModel receiver{};
};

struct RenderSettings {
    enum class Method : std::uint8_t {
        direct,  ///< light that reaches a surface straight from the Sun and the lights, with shadows, and ambient
        path,    ///< all light, by path tracing
    };
    Method method = Method::direct;
    int max_depth = 8;              ///< path: surfaces that a path may meet, 1..40 (1 is direct light alone)
    int spp = 1;                    ///< samples per pixel where there is no budget
    std::int64_t budget_ns = 0;     ///< > 0: hand-over deadline of a frame, from the end of its exposure
    std::uint64_t budget_rays = 0;  ///< > 0: a frame takes at most so many rays of all kinds
    std::uint64_t seed = 0;
    double stale_after_s = 0.5;       ///< commands older than this: the body holds still and is reported stale
    double command_ahead_max_s = 60;  ///< commands for a time further ahead are refused
};

struct Scene {
    std::string name, file;
    std::int64_t epoch_unix_ns = 0;  ///< UTC of simulation time 0
    std::optional<Sun> sun;
    std::optional<StarField> stars{};
    Rgb ambient{};  ///< radiance arriving from everywhere, W m^-2 sr^-1 a band
    std::optional<Atmosphere> atmosphere{};
    std::optional<AnalyticSky> sky{};
    std::vector<Light> lights;
    std::vector<Body> bodies;
    std::vector<Mesh> meshes;
    std::vector<Material> materials;
    std::vector<Texture> textures;
    std::vector<Camera> cameras;
    std::vector<Lidar> lidars;
    RenderSettings render;
    std::vector<std::string> warnings;  ///< told once when the scene is read: "12 degenerate triangles dropped"
};

}  // namespace narpa
