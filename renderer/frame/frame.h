/// renderer/frame/frame.h - one frame: what its rays, their light and its samples depend on.
#pragma once

#include <optional>

#include "base/camera_pose.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/frame/frame_settings.h"
#include "renderer/frame/subpixel/subpixel_bodies.h"
#include "renderer/integrator/integrator.h"

namespace narpa {

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
    const CameraModel* model;  ///< of the camera, never null
    const Lens* lens;          ///< null: pinhole, all in focus
    const std::optional<SunDisc>& sun;
    const Integrator& integrator;
    LightParts parts;  ///< the integrator's
    bool thins_paths;  ///< likewise
    Transport transport;
    SubpixelBodies subpixel_bodies;

    /// One sample per pixel goes through the centres of the pixel and of the lens, to the centre of the Sun.
    [[nodiscard]] bool one_sample() const { return settings.spp == 1; }
};

/// All arguments but the pose outlive the frame.
[[nodiscard]] Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                               const CameraPose& pose, const FrameSettings& settings);

}  // namespace narpa
