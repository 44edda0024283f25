#include "estimator/view/model_view.h"

#include <limits>

#include "renderer/camera/camera_model.h"

namespace narpa {

Rigid3 place_camera(const Rigid3& T_camera_target, const Camera& camera, std::size_t target, BodyPoses& at) {
    const Rigid3 T_world_camera = at.T_world_body[target] * inverse(T_camera_target);
    if (camera.mount >= 0)
        at.set(static_cast<std::size_t>(camera.mount), T_world_camera * inverse(camera.T_mount_camera));
    return T_world_camera;
}

ModelView::ModelView(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at)
    : render_scene_(render_scene),
      camera_(camera),
      target_(target),
      at_(at),
      renderer_(render_scene_, camera_),
      radiance_(camera.width, camera.height) {}

void ModelView::place(const Rigid3& T_camera_target) {
    T_world_camera_ = place_camera(T_camera_target, camera_, target_, at_);
}

void ModelView::render(const Rigid3& T_camera_target, const FrameSettings& settings, bool aovs) {
    place(T_camera_target);
    renderer_.render(at_, T_world_camera_, settings, radiance_, aovs ? &aovs_ : nullptr);
}

Hit ModelView::trace_pixel(double u_px, double v_px) const noexcept {
    const Ray ray = camera_ray(camera_, T_world_camera_, u_px, v_px);
    return render_scene_.tracer().intersect(at_, ray, std::numeric_limits<double>::infinity());
}

}  // namespace narpa
