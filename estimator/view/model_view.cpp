#include "estimator/view/model_view.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <vector>

namespace narpa {
namespace {

/// In images of more pixels thousands hold the pose, and what this overstates beside edges looks like a blur.
constexpr std::size_t kFewPixels = 20'000;

/// No variance below that of half a sample of the contrast with the neighbours, those that are chosen.
void allow_for_missed_light(const RadianceImage& image, int samples, std::span<const std::uint8_t> chosen,
                            std::vector<float>& variance) {
    const auto width = static_cast<std::size_t>(image.width);
    const float half_a_sample = 0.5f / static_cast<float>(samples);
    const auto is_chosen = [&](std::size_t p) { return chosen.empty() || chosen[p] != 0; };
    tbb::parallel_for(1, std::max(image.height - 1, 1), [&](int y) {
        const std::size_t row = static_cast<std::size_t>(y) * width;
        for (std::size_t p = row + 1; p + 1 < row + width; ++p) {
            if (!is_chosen(p)) continue;
            float least = mean_band(image.pixels[p]), most = least;
            for (const std::size_t middle : {p - width, p, p + width})
                for (const std::size_t q : {middle - 1, middle, middle + 1}) {
                    if (!is_chosen(q)) continue;
                    least = std::min(least, mean_band(image.pixels[q]));
                    most = std::max(most, mean_band(image.pixels[q]));
                }
            const float missed = half_a_sample * (most - least);
            variance[p] = std::max(variance[p], missed * missed);
        }
    });
}

}  // namespace

Rigid3 place_camera(const Rigid3& T_camera_target, const Camera& camera, std::size_t target, BodyPoses& at) {
    const Rigid3 T_world_camera = at.T_world_body[target] * inverse(T_camera_target);
    if (camera.mount >= 0)
        at.set(static_cast<std::size_t>(camera.mount), T_world_camera * inverse(camera.T_mount_camera));
    return T_world_camera;
}

void stand_still(const BodyPoses& moving, BodyPoses& at) {
    for (std::size_t i = 0; i < moving.T_world_body.size(); ++i) at.set(i, moving.T_world_body[i]);
}

ModelView::ModelView(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at)
    : render_scene_(render_scene),
      camera_(camera),
      target_(target),
      at_(at),
      renderer_(render_scene_, camera_, false),
      radiance_(camera.width, camera.height) {}

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
    if (radiance_.pixels.size() <= kFewPixels)
        allow_for_missed_light(radiance_, settings.spp, chosen, aovs_.variance);
}

Rigid3 ModelView::T_world_camera(double row) const noexcept {
    if (motion_ == ApparentMotion{}) return T_world_camera_;
    return T_world_target() * inverse(moved(T_camera_target_, motion_, times_.at(row)));
}

void ModelView::trace_pixels(std::span<const ImagePoint> points, HitBatch& hits) const noexcept {
    const CameraModelHandle model(camera_);
    RayBatch rays;
    rays.n = points.size();
    for (std::size_t i = 0; i < rays.n; ++i)
        rays.put(i, camera_ray(model, T_world_camera(points[i].y), points[i].x, points[i].y));
    tracer().intersect(at_, rays, tracer().all_bodies(), hits);
}

}  // namespace narpa
