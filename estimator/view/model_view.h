/// estimator/view/model_view.h - what the camera would see if the target had a certain pose.
///
/// The target stays where the world has it, in the light that falls on it there; the camera goes where the pose
/// puts it, with the body that it is mounted on.
#pragma once

#include <cstddef>

#include "renderer/film/camera_image.h"

namespace narpa {

/// Where the camera is if the target, which stays where `at` has it, has this pose. The body that carries the
/// camera is put there with it.
[[nodiscard]] Rigid3 place_camera(const Rigid3& T_camera_target, const Camera& camera, std::size_t target,
                                  BodyPoses& at);

class ModelView {
public:
    /// `render_scene` outlives it. `target`: index of the body whose pose is looked for. `at`: where every body is
    /// at the time of the frame; the target's attitude there tells how the light falls on it.
    ModelView(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at);

    /// Where every body is from now on: at another frame's time.
    void place_bodies(const BodyPoses& at) { at_ = at; }

    /// Renders the view at this pose; `aovs` tells whether depth, position, normal and body are wanted too. The
    /// budget of the settings is obeyed. Allocates nothing after the first call of a kind.
    void render(const Rigid3& T_camera_target, const FrameSettings& settings, bool aovs);

    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] const Tracer& tracer() const noexcept { return render_scene_.tracer(); }
    [[nodiscard]] std::size_t target() const noexcept { return target_; }
    /// Of the last render: linear radiance; first hits through the pixels' middles in world coordinates; and where
    /// the bodies and the camera were.
    [[nodiscard]] const RadianceImage& radiance() const noexcept { return radiance_; }
    [[nodiscard]] const Aovs& aovs() const noexcept { return aovs_; }
    [[nodiscard]] const BodyPoses& placement() const noexcept { return at_; }
    [[nodiscard]] const Rigid3& T_world_camera() const noexcept { return T_world_camera_; }
    [[nodiscard]] const Rigid3& T_world_target() const noexcept { return at_.T_world_body[target_]; }

    /// Puts camera and mount where this pose has them, without a picture: for rays of one's own.
    void place(const Rigid3& T_camera_target);
    /// What the camera, as it is placed, sees through a point of its image (pinhole; the centre of the top-left
    /// pixel is (0, 0)). `body` < 0: nothing.
    [[nodiscard]] Hit look_through(double u_px, double v_px) const noexcept;

private:
    const RenderScene& render_scene_;
    Camera camera_;
    std::size_t target_;
    BodyPoses at_;
    Rigid3 T_world_camera_{};
    CameraRenderer renderer_;
    RadianceImage radiance_;
    Aovs aovs_;
};

}  // namespace narpa
