/// renderer/film/camera_image.h - a camera's linear radiance image, and the exact outputs beside it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "renderer/camera/camera_pose.h"
#include "renderer/image/radiance_image.h"
#include "renderer/integrator/frame_settings.h"
#include "renderer/light/render_scene.h"

namespace narpa {

/// The light that reaches the camera.
///
/// Method direct: light that comes to a surface straight from the Sun and the scene's lights, with shadows;
/// ambient, never shadowed; emission of what is seen; lamps of some size too, and these in mirrors and glass; black
/// where nothing is hit, and where mirrors and glass would show other surfaces. Method path: all light (path.h),
/// with the ambient as a sky.
///
/// One sample a pixel goes through the centres of the pixel and of the lens and, where the method is direct and the
/// Sun the only light, to the centre of the Sun: the image of a pinhole, without noise, with hard shadows. With
/// more, each takes a point of the pixel, of the lens and of the Sun: edges are smooth, what is out of focus is
/// blurred, shadows have their penumbra.
///
/// Bodies less than two pixels wide are sampled apart and keep their light whatever spp is: subpixel_bodies.h.
///
/// Last come, over the whole image, vignetting and point spread (image_optics.h), the stars (star_light.h), veiling
/// glare and the Sun's ghost (sun_ghost.h). The account's error and the variance are those before them: a filter
/// averages noise, so they are upper bounds then.
///
/// A pose that moves within the exposure, or bodies that do in a picture taken over time (CameraPose), are blurred:
/// each sample takes a moment of its own, and one sample a pixel the middle of its row's exposure. Tile culling,
/// sampling of subpixel bodies and, where bodies move, path reuse are then off.
///
/// Runs on the calling thread's TBB arena. Same bytes on any number of threads. Allocates its memory with each
/// call; for many frames use CameraRenderer. `aovs` may be null; they show a pinhole's view, subpixel bodies
/// included.
void render_radiance(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                     const CameraPose& pose, const FrameSettings& settings, RadianceImage& out,
                     Aovs* aovs = nullptr);

/// The same for a camera's frames one after another, within budgets: keeps memory and measured costs from frame to
/// frame. With a budget in samples or rays, an image depends on neither. Allocates nothing after the first frame of
/// a kind. Tiles that stay empty from frame to frame are not written again: nothing else may write to `out` in
/// between.
class CameraRenderer {
public:
    /// Both outlive it. `with_stars`: those of the scene, if it has any.
    CameraRenderer(const RenderScene& render_scene, const Camera& camera, bool with_stars = true);
    ~CameraRenderer();

    FrameAccount render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings,
                        RadianceImage& out, Aovs* aovs = nullptr);
    /// With the variance of Aovs alone, which takes no rays of its own. Of `chosen` pixels alone, those that are
    /// not 0: the budget is in samples, two or more, and the others hold anything then. Empty: all.
    FrameAccount render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings,
                        RadianceImage& out, std::vector<float>& variance,
                        std::span<const std::uint8_t> chosen = {});

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
