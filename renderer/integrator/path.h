/// renderer/integrator/path.h - radiance along rays by path tracing.
///
/// Kajiya 1986 with next-event estimation towards the Sun, lights, emissive surfaces and the background where it is
/// sampled; BSDF sampling, mixed with sampling of bodies that look small (small_body_sampling.h); multiple
/// importance sampling of the two by the power heuristic (Veach 1997). A narrow Sun on a surface without a lobe is
/// left to next-event estimation alone. Russian roulette by the path's throughput, from the first bounce on where
/// some light has been found. Unbiased but for paths longer than max_depth; radiance is never clamped.
///
/// Escaped rays see the background and the Sun's disc, the camera's rays too. Where the scene has a medium, every
/// segment adds its in-scattering and is attenuated by its transmittance, shadow rays as well.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/light/render_scene.h"

namespace narpa {

struct PathSettings {
    int max_depth = 8;           ///< surfaces that scatter the light of a path; the next one may still emit
    double pixel_angle_rad = 0;  ///< width of a camera ray's beam per metre of its length, for textures
    /// Method "direct": light from the Sun and the lights to the first surface, with shadows; its own emission; the
    /// background's even term without shadows, ambient_reflectance(surface) times it. Lights with extent are seen,
    /// in mirrors too. max_depth is not read.
    bool direct = false;
    /// Sample small bodies: SmallBodySampling::may_help at these poses.
    bool small_bodies = true;
    /// Path reuse: scale of the probability with which paths survive the roulette at their first vertex.
    float first_survival = 1;
    /// False: reused_path_radiance traces each path for its own ray alone.
    bool reuse = true;
};

/// Which random numbers each ray takes: PixelSampler(seed, frame, pixel), and the place in its sequence. The first
/// four dimensions belong to the caller.
struct PathNumbers {
    std::uint64_t seed = 0;
    std::uint32_t frame = 0;
    std::span<const std::uint32_t> pixel, sample;
};

/// Radiance, W m^-2 sr^-1, along rays whose first hits are known. Any number of them: from a few dozen up, batches
/// stay full while paths end. Each result is independent of the other rays. Thread-safe, allocates nothing; takes
/// 200 kB of stack. Returns the number of rays traced.
std::uint64_t path_radiance(const RenderScene& render_scene, const BodyPoses& at, const PathSettings& settings,
                            std::span<const Ray> rays, std::span<const Hit> first, const PathNumbers& numbers,
                            std::span<Rgb> radiance) noexcept;

/// Lanes of a batch of first hits whose emission and direct sunlight are in the radiance already
/// (integrator.h), and the colours of these surfaces: flat, of Lambert's or Phong's material.
struct LitSurfaces {
    std::uint32_t lanes = 0;
    RgbLanes diffuse, specular;
};
/// One camera sample among batches: a path may begin there.
struct PathStart {
    const RayBatch* rays;
    const HitBatch* hits;
    const LitSurfaces* surfaces;
    std::size_t lane;
    std::uint32_t pixel, sample;  ///< as of PathNumbers
    bool sunlit = false;          ///< of surfaces that are lit: the sunlight there is not zero

    [[nodiscard]] bool lit() const noexcept { return is_set(surfaces->lanes, lane); }
};
/// Most paths that are reused among each other.
inline constexpr std::size_t kReuseGroup = 64;

/// The same for up to kReuseGroup rays, with path reuse (path_reuse.h): the result of each depends on the others.
/// No two should be of the same pixel, as what they find by the same path is not independent. `radiance`: out,
/// without the light that is known of lit surfaces. `variance`: out, estimate for the mean band of reused light.
std::uint64_t reused_path_radiance(const RenderScene& render_scene, const BodyPoses& at,
                                   const PathSettings& settings, std::span<const PathStart> starts,
                                   std::uint64_t seed, std::uint32_t frame, std::span<Rgb> radiance,
                                   std::span<float> variance) noexcept;

/// Widest Sun that is narrow: next-event estimation alone finds its light on surfaces without a lobe, as a ray by
/// the BSDF meets the disc so seldom that MIS would not pay.
inline constexpr double kNarrowSun_rad = 0.2;
/// A lobe with a greater exponent finds a narrow Sun better than the Sun's points find the lobe.
inline constexpr float kSharpLobe = 1000;
/// True where the direct light of first surfaces may be added apart (Frame::separate_sun): The Sun is narrow,
/// nothing else emits, there is no medium, and some body is shaded flat.
[[nodiscard]] bool sun_alone_lights_first_surfaces(const RenderScene& render_scene) noexcept;
/// Radiance along a camera ray that escapes, without a medium: the background and the Sun's disc.
[[nodiscard]] Rgb escaped_radiance(const RenderScene& render_scene, const Vec3& direction) noexcept;

}  // namespace narpa
