/// renderer/trace/frame_light.h - what stays the same over a frame, and the light that comes back along its rays.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "renderer/trace/camera_image.h"
#include "renderer/trace/path.h"
#include "renderer/trace/sun_disc.h"
#include "renderer/trace/tiny_bodies.h"

namespace narpa {

struct Frame {
    const Tracer& tracer;
    const Placement& at;
    const Camera& camera;
    const Rigid3& T_world_camera;
    const FrameSettings& settings;
    const Lens* lens;  ///< null: a pinhole
    std::optional<SunDisc> sun;
    bool quick;         ///< sunlight, ambient and emission of what is seen: all that there is to gather
    PathSettings path;  ///< where it is not
    TinyBodies tiny;

    /// A sample of a frame of one sample a pixel passes the middle of everything: pixel, lens and Sun.
    [[nodiscard]] bool one_sample() const { return settings.spp == 1; }
};

/// The arguments outlive the frame.
[[nodiscard]] Frame make_frame(const Tracer& tracer, const Placement& at, const Camera& camera,
                               const Rigid3& T_world_camera, const FrameSettings& settings);

/// Rays that are traced together, and what they meet first.
struct Packet {
    std::size_t n = 0;
    Lanes<Ray> rays;
    Lanes<Hit> hits;
    // Where the frame is quick:
    Lanes<Vec3> to_sun;  ///< a point of the Sun for each, if there is one
    // Where it is not: which random numbers each takes.
    Lanes<std::uint32_t> number{};  ///< its PixelSampler's "pixel"
    std::uint32_t sample = 0;
};

/// Radiance that comes back along each ray.
void light_along(const Frame& f, const Packet& packet, Lanes<Rgb>& radiance);

}  // namespace narpa
