/// renderer/integrator/integrator.h - the radiance along the camera rays of a frame.
///
/// One integrator serves a frame, chosen by make_frame: SunDirectLighting and DirectIntegrator for method "direct",
/// PathIntegrator for method "path". A further one is a class in files of its own and a line in make_frame.
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

/// What stays the same over a frame.
struct Frame {
    const RenderScene& render_scene;
    const Tracer& tracer;
    const BodyPoses& at;
    const Camera& camera;
    CameraPose pose;
    Rigid3 T_world_camera;  ///< at mid-exposure
    bool over_time;         ///< rays are taken at times of their own; else all at mid-exposure
    const FrameSettings& settings;
    CameraModelHandle model;
    const Lens* lens;  ///< null: none, all in focus
    std::optional<SunDisc> sun;
    const Integrator& integrator;
    bool sun_only;      ///< the integrator is SunDirectLighting
    bool separate_sun;  ///< it is PathIntegrator, and BatchRadiance::direct holds the direct sunlight at first hits
    PathSettings path;  ///< of the other integrators
    SubpixelBodies subpixel_bodies;

    /// One sample a pixel goes through the centre of the pixel and of the lens, to the centre of the Sun.
    [[nodiscard]] bool one_sample() const { return settings.spp == 1; }
};

/// All but the pose outlive the frame.
[[nodiscard]] Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                               const CameraPose& pose, const FrameSettings& settings);

/// A batch of camera samples: their rays, and what they meet first.
struct CameraBatch {
    RayBatch rays;
    HitBatch hits;
    Vec3Lanes to_sun;       ///< where `sun_only` or `separate_sun`: for each a direction to a point of the Sun
    std::uint32_t lit = 0;  ///< out, there: lanes that the Sun lights
    // Random numbers of the paths:
    Lanes<std::uint32_t> number{};  ///< PixelSampler's "pixel"
    Lanes<std::uint32_t> sample{};
    std::uint32_t path_lanes = 0;  ///< from which paths are traced
    LitSurfaces first;             ///< out, where `separate_sun`
    Lanes<float> variance;         ///< out: of the mean band of reused light, estimated
    // Counted up:
    std::uint64_t rays_traced = 0;  ///< of all kinds
    std::uint64_t path_rays = 0;    ///< of paths that are reused
    PhaseTimes* times = nullptr;    ///< null: not measured
};

/// Radiance of a batch in two parts, of which a pixel may take different numbers of samples.
struct BatchRadiance {
    RgbLanes direct;  ///< of SunDirectLighting, or the direct sunlight at first hits where `separate_sun`
    RgbLanes path;    ///< all else

    [[nodiscard]] Rgb operator()(const Frame& f, std::size_t i) const noexcept {
        return f.sun_only ? direct[i] : direct[i] + path[i];
    }
};

/// Most samples of a pixel, and most batches, that are integrated together.
inline constexpr std::size_t kMaxPixelSamples = 16, kMaxBatches = kReuseGroup * kMaxPixelSamples / kLanes;

/// Stateless; thread-safe; allocates nothing.
class Integrator {
public:
    virtual ~Integrator() = default;
    /// Along all rays of one batch, each by itself.
    virtual void radiance(const Frame& f, CameraBatch& batch, RgbLanes& radiance) const noexcept = 0;
    /// Of up to kMaxBatches batches, which hold up to kReuseGroup pixels, pixel by pixel up to kMaxPixelSamples
    /// samples of each. Paths may be reused among the pixels.
    virtual void radiance(const Frame& f, std::span<CameraBatch> batches,
                          std::span<BatchRadiance> light) const noexcept = 0;
};

/// Sun-only direct lighting, sixteen lanes at once. Most frames of method "direct" show Lambert's and Phong's
/// materials in the light of the Sun alone. These are shaded by vector instructions, material by material, with one
/// batch of shadow rays; other materials lane by lane.
class SunDirectLighting final : public Integrator {
public:
    /// True where the Sun, a uniform background and the emission of visible surfaces are all the light, and there
    /// is no medium.
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

/// Method "path": all light. Many batches together with path reuse, and, where the Sun alone emits, with the direct
/// sunlight at first hits as in SunDirectLighting. Paths then bring the rest, from fewer of the samples: at equal
/// error 9 % less time with 16 samples a pixel and 25 % with 64, on the craft by paths of four vertices.
class PathIntegrator final : public DirectIntegrator {
public:
    using DirectIntegrator::radiance;
    void radiance(const Frame& f, std::span<CameraBatch> batches,
                  std::span<BatchRadiance> light) const noexcept override;
};

/// For PathIntegrator: emission and direct sunlight of the lanes that meet flat faces of Lambert's and Phong's
/// materials without too sharp a lobe. Sets CameraBatch::first and CameraBatch::lit.
void add_first_hit_sunlight(const Frame& f, CameraBatch& p, RgbLanes& radiance) noexcept;

/// CLOCK_MONOTONIC.
[[nodiscard]] inline std::int64_t now_ns() noexcept {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Measures where a batch's time goes, where that is wanted.
class PhaseClock {
public:
    explicit PhaseClock(PhaseTimes* times) noexcept : times_(times), last_ns_(times != nullptr ? now_ns() : 0) {}
    /// The time since the last call, or since the start, was this phase's.
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
