/// renderer/integrator/integrator.h - the radiance along the camera rays of a frame.
///
/// Each frame has one integrator, chosen by make_frame: SunDirectLighting and DirectIntegrator for method "direct",
/// PathIntegrator for method "path". A new one needs its own files and a line in make_frame.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

#include "renderer/camera/camera_pose.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/integrator/frame_settings.h"
#include "renderer/integrator/path.h"
#include "renderer/integrator/subpixel_bodies.h"
#include "renderer/light/render_scene.h"
#include "renderer/light/sun_disc.h"

namespace narpa {

class Integrator;

/// Constants of a frame.
struct Frame {
    const RenderScene& render_scene;
    const Tracer& tracer;
    const BodyPoses& at;
    const Camera& camera;
    CameraPose pose;
    Rigid3 T_world_camera;  ///< at mid-exposure
    bool over_time;         ///< each ray has its own time; else all are at mid-exposure
    const FrameSettings& settings;
    const CameraModel* model;
    const Lens* lens;  ///< null: pinhole, all in focus
    std::optional<SunDisc> sun;
    const Integrator& integrator;
    bool sun_only;      ///< the integrator is SunDirectLighting
    bool separate_sun;  ///< the integrator is PathIntegrator, and BatchRadiance::direct holds the direct sunlight
                        ///< at first hits
    PathSettings path;  ///< settings of the other integrators
    SubpixelBodies subpixel_bodies;

    /// One sample per pixel goes through the centres of the pixel and of the lens, to the centre of the Sun.
    [[nodiscard]] bool one_sample() const { return settings.spp == 1; }
};

/// All arguments but the pose outlive the frame.
[[nodiscard]] Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                               const CameraPose& pose, const FrameSettings& settings);

/// A batch of camera samples: their rays and first hits.
struct CameraBatch {
    RayBatch rays;
    HitBatch hits;
    Vec3Lanes to_sun;       ///< if `sun_only` or `separate_sun`: direction to a point of the Sun for each
    std::uint32_t lit = 0;  ///< out, in the same cases: lanes lit by the Sun
    // Sample indices of the paths:
    Lanes<std::uint32_t> number{};  ///< PixelSampler's "pixel"
    Lanes<std::uint32_t> sample{};
    std::uint32_t path_lanes = 0;  ///< lanes from which paths are traced
    LitSurfaces first;             ///< out, where `separate_sun`
    Lanes<float> variance;         ///< out: estimated variance of the mean band of reused light
    // Counters:
    std::uint64_t rays_traced = 0;  ///< of all kinds
    std::uint64_t path_rays = 0;    ///< of paths that are reused
    PhaseTimes* times = nullptr;    ///< null: not measured
};

/// Radiance of a batch in two parts, for which a pixel may take different numbers of samples.
struct BatchRadiance {
    RgbLanes direct;  ///< SunDirectLighting's, or the direct sunlight at first hits if `separate_sun`
    RgbLanes path;    ///< all else

    [[nodiscard]] Rgb operator()(const Frame& f, std::size_t i) const noexcept {
        return f.sun_only ? direct[i] : direct[i] + path[i];
    }
};

/// Maximum samples per pixel and batches that are integrated together.
inline constexpr std::size_t kMaxPixelSamples = 16, kMaxBatches = kReuseGroup * kMaxPixelSamples / kLanes;

/// Stateless; thread-safe; allocates nothing.
class Integrator {
public:
    virtual ~Integrator() = default;
    /// Radiance along all rays of one batch, each on its own.
    virtual void radiance(const Frame& f, CameraBatch& batch, RgbLanes& radiance) const noexcept = 0;
    /// Radiance of up to kMaxBatches batches, which hold up to kReuseGroup pixels, pixel by pixel with up to
    /// kMaxPixelSamples samples of each. Paths may be reused among the pixels.
    virtual void radiance(const Frame& f, std::span<CameraBatch> batches,
                          std::span<BatchRadiance> light) const noexcept = 0;
};

/// Sun-only direct lighting, sixteen lanes at once. Most frames of method "direct" show Lambert's and Phong's
/// materials lit only by the Sun. These are shaded with vector instructions, material by material, with one batch
/// of shadow rays; other materials are shaded lane by lane.
class SunDirectLighting final : public Integrator {
public:
    /// True if the Sun, a uniform background and the emission of visible surfaces are the only light, and there is
    /// no medium.
    [[nodiscard]] static bool suffices(const RenderScene& render_scene) noexcept;

    void radiance(const Frame& f, CameraBatch& batch, RgbLanes& radiance) const noexcept override;
    void radiance(const Frame& f, std::span<CameraBatch> batches,
                  std::span<BatchRadiance> light) const noexcept override;
};

/// Method "direct" in any scene, by one round of the wavefront kernel (PathSettings::direct).
class DirectIntegrator : public Integrator {
public:
    void radiance(const Frame& f, CameraBatch& batch, RgbLanes& radiance) const noexcept override;
    void radiance(const Frame& f, std::span<CameraBatch> batches,
                  std::span<BatchRadiance> light) const noexcept override;
};

/// Method "path": all light. Traces many batches together with path reuse and, if the Sun is the only emitter,
/// computes the direct sunlight at first hits as SunDirectLighting does. Paths then add only the rest, from fewer
/// samples: at equal error 9 % less time with 16 samples per pixel and 25 % with 64, on the craft with paths of
/// four vertices.
class PathIntegrator final : public DirectIntegrator {
public:
    using DirectIntegrator::radiance;
    void radiance(const Frame& f, std::span<CameraBatch> batches,
                  std::span<BatchRadiance> light) const noexcept override;
};

/// For PathIntegrator: adds emission and direct sunlight in lanes that hit flat faces of Lambert's material, or of
/// Phong's unless its lobe is too sharp. Sets CameraBatch::first and CameraBatch::lit.
void add_first_hit_sunlight(const Frame& f, CameraBatch& p, RgbLanes& radiance) noexcept;

/// CLOCK_MONOTONIC.
[[nodiscard]] inline std::int64_t now_ns() noexcept {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Measures the time of a batch per phase, if enabled.
class PhaseClock {
public:
    explicit PhaseClock(PhaseTimes* times) noexcept : times_(times), last_ns_(times != nullptr ? now_ns() : 0) {}
    /// Adds the time since the last call, or since the start, to this phase.
    void ends(Phase phase) noexcept {
        if (times_ == nullptr) return;
        const std::int64_t now = now_ns();
        (*times_)[static_cast<std::size_t>(phase)] += now - last_ns_;
        last_ns_ = now;
    }

private:
    PhaseTimes* times_;
    std::int64_t last_ns_;
};

}  // namespace narpa
