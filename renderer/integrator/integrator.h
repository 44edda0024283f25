/// renderer/integrator/integrator.h - the radiance along the camera rays of a frame.
///
/// One integrator serves a frame, chosen by make_frame: SunDirectLighting and DirectIntegrator for method "direct",
/// PathIntegrator for method "path". A further one is a class in files of its own and a line in make_frame.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

#include "renderer/camera/camera_model.h"
#include "renderer/camera/camera_pose.h"
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
    bool quick;         ///< the integrator is SunDirectLighting
    bool sun_first;     ///< it is PathIntegrator, with the direct sunlight of first surfaces as a part of its own
    PathSettings path;  ///< of the other integrators
    SubpixelBodies tiny;

    /// One sample a pixel goes through the centre of the pixel and of the lens, to the centre of the Sun.
    [[nodiscard]] bool one_sample() const { return settings.spp == 1; }
};

/// All but the pose outlive the frame.
[[nodiscard]] Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                               const CameraPose& pose, const FrameSettings& settings);

/// A batch of camera samples: their rays, and what they meet first.
struct Packet {
    RayBatch rays;
    HitBatch hits;
    Vec3Lanes to_sun;       ///< where `quick` or `sun_first`: for each a direction to a point of the Sun
    std::uint32_t lit = 0;  ///< out, there: lanes that the Sun lights
    // Random numbers of the paths:
    Lanes<std::uint32_t> number{};  ///< PixelSampler's "pixel"
    Lanes<std::uint32_t> sample{};
    std::uint32_t by_paths = 0;  ///< lanes from which paths are traced
    LitSurfaces first;           ///< out, where `sun_first`
    Lanes<float> variance;       ///< out: of the mean band of reused light, estimated
    // Counted up:
    std::uint64_t rays_traced = 0;  ///< of all kinds
    std::uint64_t path_rays = 0;    ///< of paths that are reused
    PhaseTimes* times = nullptr;    ///< null: not measured
};

/// Radiance of a batch in two parts, of which a pixel may take different numbers of samples.
struct PacketLight {
    RgbLanes first;     ///< SunDirectLighting's, or direct sunlight where `sun_first`
    RgbLanes by_paths;  ///< all else

    [[nodiscard]] Rgb operator()(const Frame& f, std::size_t i) const noexcept {
        return f.quick ? first[i] : first[i] + by_paths[i];
    }
};

/// Most samples of a pixel, and most batches, that are integrated together.
inline constexpr std::size_t kOfAPixel = 16, kTogether = kReuseGroup * kOfAPixel / kLanes;

/// Stateless; thread-safe; allocates nothing.
class Integrator {
public:
    virtual ~Integrator() = default;
    /// Along all rays of one batch, each by itself.
    virtual void radiance(const Frame& f, Packet& packet, RgbLanes& radiance) const noexcept = 0;
    /// Of up to kTogether batches, which hold up to kReuseGroup pixels, pixel by pixel up to kOfAPixel samples of
    /// each. Paths may be reused among the pixels.
    virtual void radiance(const Frame& f, std::span<Packet> packets,
                          std::span<PacketLight> light) const noexcept = 0;
};

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
