/// renderer/frame/camera_image.h - a camera's linear radiance image and its AOVs.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/camera_pose.h"
#include "base/radiance_image.h"
#include "renderer/frame/frame_settings.h"
#include "renderer/light/render_scene.h"

namespace narpa {

/// The light that reaches the camera.
///
/// Method direct: direct lighting from the Sun and the scene's lights, with shadows; unshadowed ambient; emission
/// of visible surfaces; visible area lights, also those seen in mirrors and glass. Black where nothing is hit, and
/// where mirrors and glass would show other surfaces. Method path: all light (path.h), with the ambient as a sky.
///
/// One sample per pixel goes through the centres of the pixel and of the lens and, if the method is direct and the
/// Sun the only light, to the centre of the Sun: a noise-free pinhole image with hard shadows. With more samples,
/// each takes a random point of the pixel, of the lens and of the Sun: anti-aliasing, defocus and penumbrae.
///
/// Bodies less than two pixels wide are sampled separately and keep their light whatever spp is: subpixel_bodies.h.
///
/// Afterwards, vignetting and point spread (image_optics.h), the stars (star_light.h), veiling glare and the Sun's
/// ghost (sun_ghost.h) are applied to the whole image. The account's error and the variance are those before them,
/// and so upper bounds, because a filter averages noise.
///
/// A camera that moves within the exposure, or bodies that move in an image taken over time (CameraPose), cause
/// motion blur: each sample takes its own time, and one sample per pixel the middle of its row's exposure. Sampling
/// of subpixel bodies and, where bodies move, path reuse are then off.
///
/// Runs on the calling thread's TBB arena. Same bytes on any number of threads. Allocates its memory with each
/// call; for many frames use CameraRenderer. `aovs` may be null; they show a pinhole's view, subpixel bodies
/// included.
void render_radiance(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                     const CameraPose& pose, const FrameSettings& settings, RadianceImage& out,
                     Aovs* aovs = nullptr);

/// The same for a sequence of a camera's frames, within budgets: keeps memory and measured costs between frames.
/// With a budget in samples or rays, the image depends on neither. Allocates nothing after the first frame of a
/// kind. Tiles that stay empty from frame to frame are not written again: nothing else may write to `out` in
/// between.
class CameraRenderer {
public:
    /// `render_scene` outlives it. `with_stars`: renders the scene's stars, if it has any.
    CameraRenderer(const RenderScene& render_scene, const Camera& camera, bool with_stars = true);
    ~CameraRenderer();

    FrameAccount render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings,
                        RadianceImage& out, Aovs* aovs = nullptr);
    /// Outputs the variance of Aovs without the other AOVs, at no extra rays. `chosen`: renders only pixels where
    /// it is not 0; the others are undefined, and the budget must be in samples, two or more. Empty: all pixels.
    FrameAccount render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings,
                        RadianceImage& out, std::vector<float>& variance,
                        std::span<const std::uint8_t> chosen = {});

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
