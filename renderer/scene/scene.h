/// renderer/scene/scene.h - what is there to see, as plain data: the result of reading a scene file.
///
/// SI units; world frame right-handed and inertial. What a scene file does not name is not here (empty vector,
/// empty optional), costs nothing, and is decided once, before the first frame.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/pixel_format.h"
#include "base/pose.h"
#include "base/vec3.h"

namespace narpa {

/// Colour image in linear light, 16 bits a band (65535 = 1.0), rows from the top.
struct Texture {
    std::string name;
    int width = 0, height = 0;
    std::vector<std::uint16_t> rgb;  ///< 3 * width * height
};

/// Reflectance as a BRDF. Phong is the energy-conserving form of Lafortune and Willems (1994):
/// f = kd / pi + ks (n + 2) / (2 pi) max(0, R.V)^n with kd + ks <= 1 in every band.
struct Material {
    enum class Kind : std::uint8_t { lambert, phong };
    std::string name;
    Kind kind = Kind::lambert;
    Rgb diffuse{0.5f, 0.5f, 0.5f};  ///< kd: Lambert albedo
    Rgb specular{};                 ///< ks
    float exponent = 1;             ///< n
    Rgb emission{};                 ///< radiance that the surface sends out by itself, W m^-2 sr^-1
    int texture = -1;               ///< index into Scene::textures: multiplies `diffuse`; -1 is none
};

/// Triangles in the body's own frame, metres. Degenerate and non-finite ones were dropped when it was read.
struct Mesh {
    std::string name;
    std::vector<Vec3f> positions;
    std::vector<Vec3f> normals;                       ///< per vertex, or empty: flat shading
    std::vector<std::array<float, 2>> uvs;            ///< per vertex, or empty; v up, (0, 0) is the bottom left
    std::vector<std::array<std::uint32_t, 3>> faces;  ///< counter-clockwise seen from outside
    std::vector<std::uint16_t> face_material;         ///< per face, index into Scene::materials
};

struct Sphere {
    double radius_m = 1;
    int material = 0;  ///< index into Scene::materials
};

struct Body {
    std::string name;
    std::variant<int, Sphere> shape;        ///< index into Scene::meshes, or an exact sphere
    Motion initial{};                       ///< at time 0; moves on with its velocity and rate
    std::optional<std::uint32_t> can_id{};  ///< base identifier of its pose commands on CAN
};

struct Sun {
    Vec3 direction{0, 0, 1};  ///< unit, world: from the scene towards the Sun
    double irradiance_w_m2 = 1361.0;
    double angular_diameter_rad = 0.533 * 3.14159265358979323846 / 180.0;
};

/// Photons to digital numbers. Absent: an ideal sensor without noise (see Camera::white_radiance).
struct Detector {
    double exposure_s = 0.01;
    double pixel_pitch_m = 5e-6;
    double f_number = 4;
    double quantum_efficiency = 0.5;  ///< electrons per photon
    double full_well_e = 20000;
    double gain_e_per_dn = 0;  ///< 0: full_well_e / (2^bits - 1 - black_level_dn)
    double read_noise_e = 0;   ///< RMS; 0 is exactly off
    bool shot_noise = false;   ///< Poisson; false is exactly off
    int black_level_dn = 0;
    int bits = 12;  ///< ADC, 8..12
};

enum class LatePolicy : std::uint8_t { drop, repeat, late, blank };

struct Camera {
    std::string name;
    int mount = -1;  ///< body it rides on; -1 is the world
    Rigid3 T_mount_camera{};
    int width = 640, height = 480;
    double fx = 0, fy = 0, cx = 0, cy = 0;  ///< px; the centre of the top-left pixel is (0, 0)
    std::int64_t period_ns = 100'000'000;   ///< 1 / rate_hz
    PixelFormat format = PixelFormat::grey;
    bool embedded_line = false;  ///< the last row carries the frame's identity and ledger
    LatePolicy late = LatePolicy::late;
    double white_radiance = 0;  ///< radiance that an ideal sensor maps to full scale, W m^-2 sr^-1
    std::optional<Detector> detector;
};

struct Lidar {
    std::string name;
    int mount = -1;
    Rigid3 T_mount_lidar{};    ///< lidar frame: the maker's own (VLP-16: x right, y forward, z up)
    std::string model;         ///< "VLP-16"
    double rate_hz = 10;       ///< turns a second: 5..20
    double range_max_m = 100;  ///< returns beyond are not reported
};

struct RenderSettings {
    int spp = 1;
    std::uint64_t seed = 0;
    double stale_after_s = 0.5;  ///< commands older than this: the body holds still and is reported stale
};

struct Scene {
    std::string name, file;
    std::int64_t epoch_unix_ns = 0;  ///< UTC of simulation time 0
    std::optional<Sun> sun;
    Rgb ambient{};  ///< radiance arriving from everywhere, W m^-2 sr^-1 a band
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
