/// estimator/view/model_view.h - the image that the camera would take of the target at a given pose.
///
/// The target keeps its pose in the world, and so its illumination; the camera is placed relative to it, together
/// with the body that carries it. During an exposure over time only the camera moves.
#pragma once

#include <cstddef>
#include <span>

#include "estimator/view/row_times.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// T_world_camera for this pose relative to the target, whose own pose in `at` is kept. Moves the body that carries
/// the camera in `at`.
[[nodiscard]] Rigid3 place_camera(const Rigid3& T_camera_target, const Camera& camera, std::size_t target,
                                  BodyPoses& at);

/// Copies all poses as of mid-exposure without their motion: the target's motion is applied to the camera
/// (camera_path).
void copy_static_poses(const BodyPoses& moving, BodyPoses& at);

/// Leaves out the scene's stars, as they are not part of the target.
class ModelView {
public:
    /// `render_scene` outlives it. `target`: index of the body whose pose is estimated. `at`: where every body is
    /// at the time of the frame; the target's attitude there determines its illumination.
    ModelView(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at);

    /// Another frame: poses of all bodies, the target's motion in camera axes, and when rows are exposed.
    void begin_frame(const BodyPoses& at, const ApparentMotion& motion, const RowTimes& times) {
        copy_static_poses(at, at_);
        motion_ = times.at_once() ? ApparentMotion{} : motion, times_ = times;
    }

    /// Renders the image at this pose, with `aovs` also depth, position, normal and body. Allocates nothing after
    /// the first call of a kind.
    void render(const Rigid3& T_camera_target, const FrameSettings& settings, bool aovs);
    /// The image and `Aovs::variance`, but no other of them. `chosen`: CameraRenderer::render.
    void render_with_variance(const Rigid3& T_camera_target, const FrameSettings& settings,
                              std::span<const std::uint8_t> chosen = {});

    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] const Tracer& tracer() const noexcept { return render_scene_.tracer(); }
    [[nodiscard]] std::size_t target() const noexcept { return target_; }
    /// Of the last render: linear radiance; first hits through the pixel centres, world coordinates; poses of the
    /// bodies and of the camera in the middle of the exposure.
    [[nodiscard]] const RadianceImage& radiance() const noexcept { return radiance_; }
    [[nodiscard]] const Aovs& aovs() const noexcept { return aovs_; }
    [[nodiscard]] const BodyPoses& placement() const noexcept { return at_; }
    [[nodiscard]] const Rigid3& T_world_camera() const noexcept { return T_world_camera_; }
    [[nodiscard]] const Rigid3& T_world_target() const noexcept { return at_.T_world_body[target_]; }

    /// The first hits of the rays through up to kLanes image points, from the camera of the last render in the
    /// middle of their row's exposure.
    void trace_pixels(std::span<const ImagePoint> points, HitBatch& hits) const noexcept;

private:
    /// Places the camera for this pose and returns its path during the exposure.
    CameraPose place(const Rigid3& T_camera_target);
    /// Pose in the middle of the row's exposure.
    [[nodiscard]] Rigid3 T_world_camera(double row) const noexcept;

    const RenderScene& render_scene_;
    Camera camera_;
    std::size_t target_;
    BodyPoses at_;
    ApparentMotion motion_{};
    RowTimes times_{};
    Rigid3 T_world_camera_{}, T_camera_target_{};
    CameraRenderer renderer_;
    RadianceImage radiance_;
    Aovs aovs_;
};

}  // namespace narpa
