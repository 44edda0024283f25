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
#include <string_view>
#include <variant>
#include <vector>

#include "base/pose.h"
#include "base/vec3.h"
#include "renderer/material/material.h"
#include "renderer/scene/atmosphere_settings.h"
#include "renderer/scene/camera.h"
#include "renderer/scene/course.h"
#include "renderer/scene/mark.h"

namespace narpa {

class LidarModel;
class Sky;
struct ShapeKind;
struct PoseMap;  // protocols/can/pose_map.h

/// Triangles in the body's own frame, metres. Degenerate and non-finite ones were dropped when it was read.
struct Mesh {
    std::string name;
    std::vector<Vec3f> positions;
    std::vector<Vec3f> normals;                       ///< per vertex, or empty: flat shading
    std::vector<std::array<float, 2>> uvs;            ///< per vertex, or empty; v up, (0, 0) is the bottom left
    std::vector<std::array<std::uint32_t, 3>> faces;  ///< counter-clockwise seen from outside
    std::vector<std::uint16_t> face_material;         ///< per face, index into Scene::materials
    std::vector<Rgb> colours{};  ///< per vertex, linear, for Material::vertex_colours; or empty
    Vec3 origin_m{};             ///< of the positions, in the body's frame
    bool height_field = false;   ///< a terrain: counts as open, whatever its edges
};

/// A shape in the body's own frame that is not made of triangles. Kinds: renderer/geometry/shape_kind.h.
struct ExactShape {
    const ShapeKind* kind = nullptr;  ///< never null
    std::vector<double> values{};     ///< the kind's parameters, in the order of its keys
    int material = 0;                 ///< index into Scene::materials
};

struct Body {
    std::string name;
    std::variant<int, ExactShape> shape;       ///< index into Scene::meshes, or an exact shape
    std::optional<int> mesh_material{};        ///< of all faces of its mesh, in place of the mesh's own; index
    Motion initial{};                          ///< at time 0
    std::shared_ptr<const Course> course{};    ///< null: constant velocity and rate from `initial`
    std::optional<std::uint32_t> can_id{};     ///< base identifier of its pose commands on CAN
    std::shared_ptr<const PoseMap> can_map{};  ///< its pose from other messages too; null: none
    std::vector<Mark> marks{};
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
    static constexpr std::array<std::string_view, 4> kKindNames{"point", "directional", "rectangle", "disc"};

    std::string name;
    Kind kind = Kind::point;
    int mount = -1;  ///< body it rides on; -1 is the world
    Rigid3 T_mount_light{};
    Rgb emission{};
    double width_m = 1, height_m = 1;  ///< rectangle: along its x and y, centred
    double radius_m = 0.5;             ///< disc
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
    static constexpr std::array<std::string_view, 2> kMethodNames{"direct", "path"};

    Method method = Method::direct;
    int max_depth = 8;              ///< path: surfaces that a path may meet, 1..40 (1 is direct light alone)
    int spp = 1;                    ///< samples per pixel where there is no budget
    std::int64_t budget_ns = 0;     ///< > 0: hand-over deadline of a frame, from the end of its exposure
    std::uint64_t budget_rays = 0;  ///< > 0: a frame takes at most so many rays of all kinds
    bool keep_deadline = true;      ///< in real time: a frame takes less than `spp` rather than be late
    std::uint64_t seed = 0;
    double stale_after_s = 0.5;       ///< commands older than this: the body holds still and is reported stale
    double command_ahead_max_s = 60;  ///< commands for a time further ahead are refused
};

/// The clock of real-time runs, and what follows from it.
struct TimeSettings {
    enum class Source : std::uint8_t {
        free,    ///< starts with the run; UTC is the scene's epoch plus simulation time
        system,  ///< starts at a whole UTC second of the system's clock, which time stamps then follow
    };
    static constexpr std::array<std::string_view, 2> kSourceNames{"free", "system"};
    /// When the dynamics begin again with earlier times.
    enum class OnRestart : std::uint8_t { refuse, new_run };
    static constexpr std::array<std::string_view, 2> kOnRestartNames{"refuse", "new_run"};

    Source source = Source::free;
    OnRestart on_restart = OnRestart::refuse;
    /// Path of the socket on which ptp4l answers management messages; empty: the usual paths. Of Source::system.
    std::string ptp4l{};
    int ptp4l_domain = 0;  ///< PTP domain of that ptp4l
};

/// What narpa does on CAN besides commands and telemetry.
struct CanSettings {
    std::int64_t sync_period_ns = 0;  ///< of CANopen's SYNC, sent by narpa; 0: not sent
    std::int64_t time_period_ns = 0;  ///< of CANopen's TIME; 0: not sent
    std::uint32_t time_id = 0x100;    ///< of TIME (CiA 301)

    /// Of two buses (ECSS-E-ST-50-15C, redundancy).
    enum class Redundancy : std::uint8_t {
        hot,   ///< both carry everything: what comes first counts
        cold,  ///< one is in use; the other takes over after its master's heartbeat has been missing
    };
    static constexpr std::array<std::string_view, 2> kRedundancyNames{"hot", "cold"};
    Redundancy redundancy = Redundancy::hot;
    std::uint32_t heartbeat_id = 0;                   ///< of the master that selects the bus; 0: any frame counts
    std::int64_t heartbeat_timeout_ns = 500'000'000;  ///< after which the other bus is used
};

struct Scene {
    std::string name, file;
    std::vector<std::string> overrides{};  ///< KEY=VALUE of `--set`, in place of the file's
    std::int64_t epoch_unix_ns = 0;        ///< UTC of simulation time 0
    std::optional<Sun> sun;
    std::optional<StarField> stars{};
    Rgb ambient{};  ///< radiance arriving from everywhere, W m^-2 sr^-1 a band
    std::optional<Atmosphere> atmosphere{};
    std::shared_ptr<const Sky> sky{};  ///< null: none; kinds: renderer/light/sky_kind.h
    std::vector<Light> lights;
    std::vector<Body> bodies;
    std::vector<Mesh> meshes;
    std::vector<Material> materials;
    std::vector<Texture> textures;
    std::vector<Camera> cameras;
    std::vector<Lidar> lidars;
    RenderSettings render;
    TimeSettings time{};
    CanSettings can{};
    std::vector<std::string> warnings;  ///< told once when the scene is read: "12 degenerate triangles dropped"
};

}  // namespace narpa
