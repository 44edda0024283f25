/// renderer/integrator/integrator.h - radiance along rays whose first hits are known.
///
/// An integrator knows the scene, the poses of its bodies and the sample numbers of the rays, but no camera, image
/// or budget: renderer/frame makes the rays and accumulates the radiance. A frame chooses one with
/// `integrator_for`. A new one needs its own files and a place in `integrator_kinds`.
#pragma once

#include <cassert>
#include <cstdint>
#include <span>
#include <string_view>

#include "renderer/integrator/path.h"
#include "renderer/integrator/phase_clock.h"

namespace narpa {

/// A batch of rays and their first hits.
struct TracedRays {
    RayBatch rays;
    HitBatch hits;
    Vec3Lanes to_sun;  ///< for integrators with a direct part: direction to a point of the Sun for each
    // Sample indices of the paths, as in PathStart:
    Lanes<std::uint32_t> number{}, sample{};
    std::uint32_t path_lanes = 0;  ///< lanes from which paths are traced
    std::uint32_t lit = 0;         ///< out, from integrators with a direct part: lanes lit by the Sun
    std::uint32_t complete = 0;    ///< out, for path tracing: lanes to whose radiance a path adds nothing
    LitSurfaces first;             ///< out, for path tracing: surfaces whose direct sunlight is known
    Lanes<float> variance;         ///< out: estimated variance of the mean band of reused light
    // Counters:
    std::uint64_t rays_traced = 0;  ///< of all kinds
    std::uint64_t path_rays = 0;    ///< of paths that are reused
    PhaseTimes* times = nullptr;    ///< null: not measured
};

/// The parts of the radiance that an integrator computes.
enum class LightParts : std::uint8_t { direct, path, both };

/// Radiance of a batch in two parts, for which a pixel may take different numbers of samples. Only the integrator's
/// parts are set.
struct BatchRadiance {
    RgbLanes direct;  ///< light that needs no path, which may include sunlight at first hits
    RgbLanes path;    ///< all else

    [[nodiscard]] Rgb total(LightParts parts, std::size_t i) const noexcept {
        if (parts == LightParts::both) return direct[i] + path[i];
        return parts == LightParts::direct ? direct[i] : path[i];
    }
};

/// Maximum samples per pixel and batches that are integrated together.
inline constexpr std::size_t kMaxPixelSamples = 16, kMaxBatches = kReuseGroup * kMaxPixelSamples / kLanes;

/// Stateless; thread-safe; allocates nothing.
class Integrator {
public:
    virtual ~Integrator() = default;
    [[nodiscard]] virtual LightParts parts() const noexcept = 0;
    /// Light in two parts: only some of a pixel's samples need a path (paths_of).
    [[nodiscard]] virtual bool thins_paths() const noexcept { return false; }
    /// Radiance along all rays of one batch, each on its own.
    virtual void radiance(const Transport& t, TracedRays& batch, RgbLanes& radiance) const noexcept = 0;
    /// Radiance of up to kMaxBatches batches, which hold up to kReuseGroup pixels, pixel by pixel with up to
    /// kMaxPixelSamples samples of each. Paths may be reused among the pixels.
    virtual void radiance(const Transport& t, std::span<TracedRays> batches,
                          std::span<BatchRadiance> light) const noexcept = 0;
};

/// A method of light transport.
struct IntegratorKind {
    RenderSettings::Method method;
    std::string_view name, help;
    /// The fastest integrator that computes all light of the scene by this method. `separate_sun`: it may have a
    /// direct part beside its paths.
    const Integrator& (*choose)(const RenderScene& render_scene, bool separate_sun);
};
[[nodiscard]] std::span<const IntegratorKind> integrator_kinds() noexcept;
[[nodiscard]] const IntegratorKind& integrator_kind(RenderSettings::Method method) noexcept;

}  // namespace narpa
