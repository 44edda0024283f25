/// renderer/integrator/path.h - radiance along rays by path tracing.
///
/// Kajiya 1986 with next-event estimation towards the Sun, lights, emissive surfaces and a background that is
/// importance-sampled; BSDF sampling, mixed with sampling of bodies of small angular size (small_body_sampling.h);
/// multiple importance sampling of the two by the power heuristic (Veach 1997). A narrow Sun on a surface without a
/// lobe is sampled by next-event estimation alone. Russian roulette by the path's throughput, from the first bounce
/// on once some light has been found. Unbiased except for paths longer than max_depth; radiance is never clamped.
///
/// Escaped rays, camera rays included, see the background and the Sun's disc. If the scene has a medium, every
/// segment, also of shadow rays, is attenuated by its transmittance, and adds its in-scattering.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/light/render_scene.h"

namespace narpa {

struct PathSettings {
    int max_depth = 8;           ///< surfaces that scatter the light of a path; the next one may still emit
    double pixel_angle_rad = 0;  ///< pixel footprint per metre of a camera ray's length, for texture filtering
    /// Method "direct": light from the Sun and the lights to the first surface, with shadows; its own emission; the
    /// background's uniform part without shadows, times ambient_reflectance(surface). Area lights are visible, in
    /// mirrors too. max_depth is not read.
    bool direct = false;
    /// Sample small bodies: SmallBodySampling::may_help at these poses.
    bool small_bodies = true;
    /// Path reuse: factor on the probability that a path survives Russian roulette at its first vertex.
    float first_survival = 1;
    /// False: in reused_path_radiance, each path serves only its own ray.
    bool reuse = true;
};

/// Constants of the light in a frame.
struct Transport {
    const RenderScene& render_scene;
    const BodyPoses& at;
    PathSettings path;
    std::uint64_t seed = 0;  ///< samples depend only on (seed, frame, pixel, sample)
    std::uint32_t frame = 0;
};

/// Lanes of a batch of first hits whose emission and direct sunlight are already known (SunPathIntegrator),
/// and the reflectances of these surfaces: flat, of Lambert's or Phong's material.
struct LitSurfaces {
    std::uint32_t lanes = 0;
    RgbLanes diffuse, specular;
};
/// A lane of a batch of rays and their first hits, from which a path begins.
struct PathStart {
    const RayBatch* rays;
    const HitBatch* hits;
    const LitSurfaces* surfaces;  ///< null: nothing is known of the light
    std::size_t lane;
    /// PixelSampler(seed, frame, pixel), and the index in its sequence. The first four dimensions are the caller's.
    std::uint32_t pixel, sample;
    bool sunlit = false;          ///< if lit(): the direct sunlight there is not zero
    bool emission_known = false;  ///< the light that the ray meets itself is known

    [[nodiscard]] bool lit() const noexcept { return surfaces != nullptr && is_set(surfaces->lanes, lane); }
};

/// Radiance, W m^-2 sr^-1, along any number of rays; with a few dozen or more, batches stay full while paths end.
/// Each result is independent of the other rays. Thread-safe, allocates nothing; takes 200 kB of stack. Returns the
/// number of rays traced.
std::uint64_t path_radiance(const Transport& t, std::span<const PathStart> starts,
                            std::span<Rgb> radiance) noexcept;

/// Maximum number of paths that are reused among each other.
inline constexpr std::size_t kReuseGroup = 64;

/// The same for up to kReuseGroup rays, with path reuse (path_reuse.h): each result depends on the others. No two
/// rays should belong to the same pixel, because results from the same path are correlated. `radiance`: out,
/// without the light of LitSurfaces that is already known. `variance`: out, estimated for the mean band of reused
/// light.
std::uint64_t reused_path_radiance(const Transport& t, std::span<const PathStart> starts, std::span<Rgb> radiance,
                                   std::span<float> variance) noexcept;

/// Largest angular diameter of a narrow Sun: next-event estimation alone finds its light on surfaces without a
/// lobe, because BSDF samples hit the disc so rarely that MIS would not pay.
inline constexpr double kNarrowSun_rad = 0.2;
/// A lobe with a larger exponent is sampled better by the BSDF than by points of a narrow Sun.
inline constexpr float kSharpLobe = 1000;

}  // namespace narpa
