/// renderer/integrator/path.h - all light that comes back along a ray: path tracing.
///
/// Kajiya 1986 with next-event estimation towards the Sun, the lights and emissive surfaces, importance sampling of
/// the BSDF and of bodies that look small (guide.h), and multiple importance sampling between the two by the power
/// heuristic (Veach 1997); a narrow Sun on a surface without a lobe is left to the former alone. Russian roulette
/// by the path's throughput, from the first bounce on where some light has been found. Unbiased but for paths
/// longer than max_depth. Kept light is never clamped.
///
/// The sky is the scene's ambient radiance, the same in all directions. It and the Sun's disc are seen where
/// nothing is in the way, by the camera too.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/light/render_scene.h"

namespace narpa {

struct PathSettings {
    int max_depth = 8;           ///< surfaces on which light may turn on its way; the next may still shine itself
    double pixel_angle_rad = 0;  ///< width of a camera ray's beam per metre of its way, for textures
    /// Light of method "direct", for scenes with lights (Lights::beyond_the_sun): what the Sun and the lights send
    /// straight to the first surface, with shadows; what it shines by itself; the ambient as an even term without
    /// shadows, ambient_reflectance(surface) times it; black where nothing is hit. Lights with extent are seen, in
    /// mirrors too. max_depth is not read.
    bool direct = false;
    /// SmallBodySampling::may_help at this placement; false where it may not: nobody asks further.
    bool guided = true;
    /// Of paths that share what they find: the part of them that sets out.
    float sets_out = 1;
};

/// Which random numbers each ray takes: PixelSampler(seed, frame, pixel), and the place in its sequence. The first
/// four dimensions belong to the caller.
struct PathNumbers {
    std::uint64_t seed = 0;
    std::uint32_t frame = 0;
    std::span<const std::uint32_t> pixel, sample;
};

/// Radiance, W m^-2 sr^-1, that comes back along rays whose first hits are known. Any number of them: from a few
/// dozen up, packets stay full while paths end. Same values whatever the other rays are. Thread-safe, allocates
/// nothing; takes 200 kB of stack. Returns the number of rays that it traced.
std::uint64_t path_radiance(const RenderScene& render_scene, const BodyPoses& at, const PathSettings& settings,
                            std::span<const Ray> rays, std::span<const Hit> first, const PathNumbers& numbers,
                            std::span<Rgb> radiance) noexcept;

/// What up to kLanes rays meet first, and what of it is known.
struct FirstSurfaces {
    /// Hits on flat faces of Lambert's and Phong's materials whose own emission and light straight from the Sun
    /// stand in the radiance already, and these colours of theirs. Only where nothing else shines but the ambient.
    std::uint32_t lit = 0;
    RgbLanes diffuse, specular;
};
/// One of them.
struct FirstSurface {
    const RayBatch* rays;
    const HitBatch* hits;
    const FirstSurfaces* surfaces;
    std::size_t lane;
    std::uint32_t pixel, sample;  ///< as of PathNumbers
    bool sunlit = false;          ///< of lit ones: there is some of that light

    [[nodiscard]] bool met() const noexcept { return is_set(hits->met, lane); }
    [[nodiscard]] bool lit() const noexcept { return is_set(surfaces->lit, lane); }
};
/// Paths that may share what they find.
inline constexpr std::size_t kSharing = 64;
/// A lobe this sharp finds the narrow Sun better than the Sun's points find the lobe.
inline constexpr float kSharpLobe = 1000;
/// May the Sun's light on first surfaces be taken as above?
[[nodiscard]] bool sun_alone_lights_first_surfaces(const RenderScene& render_scene) noexcept;
/// What a ray brings that meets nothing and that nobody else speaks for: the sky, and the Sun's disc in it.
[[nodiscard]] Rgb sky_along(const RenderScene& render_scene, const Vec3& direction) noexcept;

/// The same of up to kSharing rays, but what one path finds lights the first surfaces of all (shared_bounces.h), so
/// that the result of each ray depends on the others. No two should be the same pixel's: what they find by the same
/// path is not independent. `radiance`: out, but for the light that lit surfaces have. `variance`: out, of the mean
/// band of what is shared, roughly.
std::uint64_t shared_path_radiance(const RenderScene& render_scene, const BodyPoses& at,
                                   const PathSettings& settings, std::span<const FirstSurface> first,
                                   std::uint64_t seed, std::uint32_t frame, std::span<Rgb> radiance,
                                   std::span<float> variance) noexcept;

}  // namespace narpa
