/// renderer/integrator/frame_light.h - what stays the same over a frame, and the light that comes back along its
/// rays.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

#include "renderer/integrator/frame_settings.h"
#include "renderer/integrator/path.h"
#include "renderer/integrator/subpixel_bodies.h"
#include "renderer/light/sun_disc.h"

namespace narpa {

struct Frame {
    const RenderScene& render_scene;
    const Tracer& tracer;
    const BodyPoses& at;
    const Camera& camera;
    const Rigid3& T_world_camera;
    const FrameSettings& settings;
    const Lens* lens;  ///< null: a pinhole
    std::optional<SunDisc> sun;
    bool quick;         ///< sunlight, ambient and emission of what is seen: all that there is to gather
    bool sun_first;     ///< where it is not: the Sun lights first surfaces as in a quick frame
    PathSettings path;  ///< where it is not
    SubpixelBodies tiny;

    /// A sample of a frame of one sample a pixel passes the middle of everything: pixel, lens and Sun.
    [[nodiscard]] bool one_sample() const { return settings.spp == 1; }
};

/// The arguments outlive the frame.
[[nodiscard]] Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                               const Rigid3& T_world_camera, const FrameSettings& settings);

/// Rays that are traced together, and what they meet first.
struct Packet {
    RayBatch rays;
    HitBatch hits;
    // Where the frame is quick, or takes the Sun first:
    Vec3Lanes to_sun;       ///< a point of the Sun for each, if there is one
    std::uint32_t lit = 0;  ///< out: those that the Sun lights
    // Where it is not: which random numbers each takes.
    Lanes<std::uint32_t> number{};  ///< its PixelSampler's "pixel"
    Lanes<std::uint32_t> sample{};
    std::uint32_t by_paths = 0;  ///< those that paths follow, where there are packets of them
    FirstSurfaces first;         ///< out: where the Sun comes first
    Lanes<float> variance;       ///< out: of the mean band of light that paths share
    // Counted on from packet to packet:
    std::uint64_t rays_traced = 0;  ///< of all kinds
    std::uint64_t path_rays = 0;    ///< of them those of paths that share
    PhaseTimes* times = nullptr;    ///< null: nobody looks
};

/// CLOCK_MONOTONIC.
[[nodiscard]] inline std::int64_t now_ns() noexcept {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Where a packet's time goes, if anybody looks.
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

/// Radiance that comes back along each ray.
void light_along(const Frame& f, Packet& packet, RgbLanes& radiance);

/// In two parts, of which a pixel may take different numbers of samples.
struct PacketLight {
    RgbLanes first;     ///< of quick frames all; else what the Sun sends by first surfaces, where it comes first
    RgbLanes by_paths;  ///< else the rest, of the samples that paths follow

    [[nodiscard]] Rgb operator()(const Frame& f, std::size_t i) const noexcept {
        return f.quick ? first[i] : first[i] + by_paths[i];
    }
};

/// The same of many packets, whose paths share what they find: of up to kSharing pixels, pixel by pixel up to
/// kOfAPixel samples each.
inline constexpr std::size_t kOfAPixel = 16, kTogether = kSharing * kOfAPixel / kLanes;
void light_along(const Frame& f, std::span<Packet> packets, std::span<PacketLight> light);

}  // namespace narpa
