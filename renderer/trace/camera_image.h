/// renderer/trace/camera_image.h - a camera's linear radiance image, and the exact outputs beside it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "renderer/trace/frame_budget.h"
#include "renderer/trace/tracer.h"

namespace narpa {

/// Outputs at the first hit through each pixel's centre, wanted only by `narpa render --aov`.
/// Background: depth and range infinite, body -1, the rest zero.
struct Aovs {
    std::vector<double> range_m, depth_m;  ///< along the ray; along the camera's z axis
    std::vector<Vec3> position, normal;    ///< world
    std::vector<std::int32_t> body;
    std::vector<Rgb> albedo;  ///< base colour with its texture: a mirror's reflectance, white for glass
    /// Of the pixel's mean over the bands (0 for spp < 2, but for tiny bodies), W^2 m^-4 sr^-2: pixel_samples.h
    /// says how it is estimated and which 95 % interval goes with it. Within a budget: what a frame expects of
    /// itself (frame_error.h), where it came to refined; else 0.
    std::vector<float> variance;
};

/// Row-major, height x width, linear radiance in W m^-2 sr^-1 a band.
struct RadianceImage {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;

    RadianceImage(int w, int h)
        : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
};

struct FrameSettings {
    int spp = 1;             ///< 1: the ray through each pixel's centre
    std::uint64_t seed = 0;  ///< scene seed; samples depend on (seed, frame, pixel, sample) and nothing else
    std::uint32_t frame = 0;
    RenderSettings::Method method = RenderSettings::Method::direct;
    int max_depth = 8;                                ///< of method path
    std::atomic<std::size_t>* pixels_done = nullptr;  ///< counted up while the frame is made; null: nobody looks
    FrameBudget budget{};                             ///< kind samples: spp
    bool times = false;                               ///< tell where the time goes
};

/// The light that reaches the camera.
///
/// Method direct: light that comes to a surface straight from the Sun and the scene's lights, with shadows;
/// ambient, never shadowed; emission of what is seen; lamps of some size too, and these in mirrors and glass; black
/// where nothing is hit, and where mirrors and glass would show other surfaces. Method path: all light (path.h),
/// with the ambient as a sky.
///
/// One sample a pixel goes through the middle of the pixel and of the lens, and where the method is direct and the
/// Sun the only light, to the middle of the Sun: the image of a pinhole, without noise, with hard shadows. With
/// more, each takes a point of the pixel, of the lens and of the Sun: edges are smooth, what is out of focus is
/// blurred, shadows have their penumbra.
///
/// Bodies less than two pixels wide are sampled apart and keep their light whatever spp is: tiny_bodies.h.
///
/// Runs on the calling thread's TBB arena. Same bytes whatever the number of threads. Takes its memory anew with
/// each call: for many frames there is CameraRenderer. `aovs` may be null; they show a pinhole's view, tiny bodies
/// among the rest.
void render_radiance(const Tracer& tracer, const Placement& at, const Camera& camera, const Rigid3& T_world_camera,
                     const FrameSettings& settings, RadianceImage& out, Aovs* aovs = nullptr);

/// The same, for a camera's frames one after another: keeps memory and measures from frame to frame, and knows
/// budgets. What a frame looks like depends on neither. Allocates nothing after the first frame of a kind. Tiles
/// that stay empty from frame to frame are not written again: nobody else may write to `out` in between.
class CameraRenderer {
public:
    /// Both outlive it.
    CameraRenderer(const Tracer& tracer, const Camera& camera);
    ~CameraRenderer();

    FrameAccount render(const Placement& at, const Rigid3& T_world_camera, const FrameSettings& settings,
                        RadianceImage& out, Aovs* aovs = nullptr);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Shot and return of a LiDAR or any other range finder.
struct LidarReturn {
    double range_m = 0;  ///< 0: no return
    float reflectivity =
        0;  ///< diffuse reflectance seen along the beam: pi * BRDF(-d, -d) * cos(incidence), mean of bands
    int body = -1;
};
/// One ray; its bodies where they are at the shot's own time.
[[nodiscard]] LidarReturn shoot(const Tracer& tracer, const Placement& at, const Ray& beam,
                                double range_max_m) noexcept;

}  // namespace narpa
