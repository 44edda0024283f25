#include "estimator/view/model_view.h"

#include <cassert>

namespace narpa {

Rigid3 place_camera(const Rigid3& T_camera_target, const Camera& camera, std::size_t target, BodyPoses& at) {
    const Rigid3 T_world_camera = at.T_world_body[target] * inverse(T_camera_target);
    if (camera.mount >= 0)
        at.set(static_cast<std::size_t>(camera.mount), T_world_camera * inverse(camera.T_mount_camera));
    return T_world_camera;
}

void copy_static_poses(const BodyPoses& moving, BodyPoses& at) {
    for (std::size_t i = 0; i < moving.T_world_body.size(); ++i) at.set(i, moving.T_world_body[i]);
}

ModelView::ModelView(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at)
    : render_scene_(render_scene),
      camera_(camera),
      target_(target),
      at_(at),
      renderer_(render_scene_, camera_, false),
      radiance_(camera.width, camera.height) {
    assert(target < at.T_world_body.size());
}

CameraPose ModelView::place(const Rigid3& T_camera_target) {
    T_camera_target_ = T_camera_target;
    T_world_camera_ = place_camera(T_camera_target, camera_, target_, at_);
    return camera_path(T_world_target(), T_camera_target, motion_, times_, camera_.height);
}

void ModelView::render(const Rigid3& T_camera_target, const FrameSettings& settings, bool aovs) {
    const CameraPose path = place(T_camera_target);
    renderer_.render(at_, path, settings, radiance_, aovs ? &aovs_ : nullptr);
}

void ModelView::render_with_variance(const Rigid3& T_camera_target, const FrameSettings& settings,
                                     std::span<const std::uint8_t> chosen) {
    const CameraPose path = place(T_camera_target);
    renderer_.render(at_, path, settings, radiance_, aovs_.variance, chosen);
}

Rigid3 ModelView::T_world_camera(double row) const noexcept {
    if (motion_ == ApparentMotion{}) return T_world_camera_;
    return T_world_target() * inverse(moved(T_camera_target_, motion_, times_.at(row)));
}

void ModelView::trace_pixels(std::span<const ImagePoint> points, HitBatch& hits) const noexcept {
    assert(points.size() <= kLanes);
    RayBatch rays;
    rays.n = points.size();
    for (std::size_t i = 0; i < rays.n; ++i)
        rays.put(i, camera_ray(camera_, T_world_camera(points[i].y), points[i].x, points[i].y));
    tracer().intersect(at_, rays, tracer().all_bodies(), hits);
}

}  // namespace narpa
