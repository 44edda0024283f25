/// renderer/material/material.h - how a surface scatters light, as plain data: materials and their textures.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/vec3.h"

namespace narpa {

/// Image in linear light, 16 bits per band (65535 = 1.0), rows from the top; with a mip map: the image at half, a
/// quarter ... of the size, down to 1 x 1, each texel the mean of the area that it covers.
struct Texture {
    enum class Wrap : std::uint8_t { repeat, clamp };
    struct Level {
        int width = 0, height = 0;
        std::vector<std::uint16_t> rgb;  ///< 3 * width * height
    };
    std::string name;
    int width = 0, height = 0;
    std::vector<std::uint16_t> rgb;  ///< 3 * width * height
    Wrap wrap = Wrap::repeat;
    std::vector<Level> coarser{};  ///< mip levels; empty: only the finest level is used
};

/// Parameters of B. Hapke's model (Theory of Reflectance and Emittance Spectroscopy, 2nd ed. 2012) beside the
/// single scattering albedo w, which is Material::diffuse.
struct Hapke {
    float phase_b = 0.25f, phase_c = 0.4f;          ///< double Henyey-Greenstein: width, backward (> 0) or forward
    float opposition_b0 = 0, opposition_h = 0.05f;  ///< shadow hiding: amplitude, width
    float roughness_rad = 0;                        ///< macroscopic mean slope, theta-bar
};

/// What the rows of a globe's maps are latitudes of, and their columns longitudes of, on an ellipsoid (P. K.
/// Seidelmann et al., Celest. Mech. Dyn. Astron. 98, 2007).
enum class MapLatitude : std::uint8_t {
    planetographic,  ///< the outward normal
    planetocentric,  ///< the line from the centre
    parametric,      ///< that line after scaling the axes so that the ellipsoid is a sphere
};
inline constexpr std::array<std::string_view, 3> kMapLatitudeNames{"planetographic", "planetocentric",
                                                                   "parametric"};

/// A row of the table of kinds: bsdf_kind.h.
struct BsdfKind;
namespace kinds {
extern const BsdfKind lambert;          ///< diffuse
extern const BsdfKind phong;            ///< diffuse, specular, exponent: diffuse + specular <= 1
extern const BsdfKind phong_classic;    ///< diffuse, specular, exponent, ambient: the paper's; direct light only
extern const BsdfKind mirror;           ///< specular
extern const BsdfKind dielectric;       ///< smooth glass: ior, schlick
extern const BsdfKind ggx;              ///< diffuse (base colour), metallic, roughness, ior
extern const BsdfKind lommel_seeliger;  ///< diffuse (single scattering albedo w), asymmetry
extern const BsdfKind lunar_lambert;    ///< diffuse (normal albedo): McEwen 1996
extern const BsdfKind akimov;           ///< diffuse (normal albedo): Shkuratov et al. 2011
extern const BsdfKind hapke;            ///< diffuse (single scattering albedo w), hapke
}  // namespace kinds

/// How a surface scatters light. Directions and forms: renderer/material/bsdf.h. Each kind uses only the parameters
/// that are listed with it above.
struct Material {
    std::string name;
    const BsdfKind* kind = &kinds::lambert;  ///< never null
    Rgb diffuse{0.5f, 0.5f, 0.5f};           ///< kd, base colour, normal albedo or w, depending on the kind
    Rgb specular{};                          ///< ks
    float exponent = 1;                      ///< n of Phong's lobe
    Rgb emission{};                          ///< emitted radiance, W m^-2 sr^-1
    Rgb ambient{};                           ///< ka
    float roughness = 0.5f;                  ///< perceptual: GGX alpha = roughness^2
    float metallic = 0;                      ///< 0 dielectric over Lambert, 1 metal
    float ior = 1.5f;                        ///< refractive index inside over outside
    bool schlick = false;                    ///< Schlick's approximation in place of Fresnel's equations
    float asymmetry = 0;                     ///< Henyey-Greenstein's g of the single particle: negative is backward
    Hapke hapke{};
    int texture = -1;           ///< index into Scene::textures: multiplies `diffuse`; -1 is none
    int emission_texture = -1;  ///< multiplies `emission`
    int specular_texture = -1;  ///< multiplies `specular`, e.g. for an ocean that glints beside land
    int cloud_texture = -1;     ///< share of the surface covered by white diffuse clouds, close above it
    Rgb cloud_albedo{};
    int normal_texture = -1;  ///< tangent space: 2 rgb - 1 = (along u, along v, out), times (scale, scale, 1)
    int height_texture = -1;  ///< bumps: height in metres = bump_height_m * mean of rgb
    MapLatitude map_latitude = MapLatitude::planetographic;  ///< of all these on an ellipsoid
    float normal_scale = 1;
    float bump_height_m = 0;
    int vertex_colours = -1;     ///< 0: Mesh::colours multiply `diffuse`; -1 is none
    float retroreflectance = 0;  ///< towards a LiDAR, added to the kind's; relative to a white diffuse surface
};

/// True if there are textures besides that of `diffuse`, or vertex colours.
[[nodiscard]] inline bool has_more_than_colour(const Material& m) noexcept {
    // The sign bit is set where all are -1: one jump, as this is asked at each hit.
    return (m.emission_texture & m.specular_texture & m.cloud_texture & m.normal_texture & m.height_texture &
            m.vertex_colours) >= 0;
}
[[nodiscard]] inline bool is_textured(const Material& m) noexcept {
    return (m.texture & m.emission_texture & m.specular_texture & m.cloud_texture & m.normal_texture &
            m.height_texture & m.vertex_colours) >= 0;
}
/// True if the emission varies over the surface.
[[nodiscard]] inline bool has_emission_map(const Material& m) noexcept {
    return m.emission_texture >= 0 || m.cloud_texture >= 0;
}

}  // namespace narpa
