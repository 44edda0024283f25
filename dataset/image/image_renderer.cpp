#include "dataset/image/image_renderer.h"

#include "renderer/detector/detector.h"

namespace narpa::dataset {
namespace {

void apply_factors(const ExposureFactors& factors, const Camera& of_scene, Camera& camera) {
    if (!of_scene.detector) {
        camera.white_radiance = of_scene.white_radiance / factors.time;
        return;
    }
    camera.detector->exposure_s = of_scene.detector->exposure_s * factors.time;
    camera.detector->gain_e_per_dn = gain_e_per_dn(*of_scene.detector) / factors.gain;
}

}  // namespace

ImageRenderer::ImageRenderer(std::shared_ptr<ImageScene> scene)
    : scene_(std::move(scene)),
      camera_(scene_->camera()),
      renderer_(scene_->render_scene(), camera_),
      sensor_array_(SensorArray::create(camera_, scene_->scene().render.seed)),
      radiance_(camera_.width, camera_.height),
      poses_(scene_->scene().bodies.size()),
      bytes_(frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns})) {}

void ImageRenderer::render(const Placement& placement, const ExposureFactors& factors, std::uint64_t seed,
                           std::uint32_t image) {
    const RenderSettings& render = scene_->scene().render;
    apply_factors(factors, scene_->camera(), camera_);
    poses_ = placement.poses();
    CameraPose pose(placement.T_world_camera);
    const double half_s = camera_.detector ? 0.5 * camera_.detector->exposure_s : 0;
    pose.set_clock(-half_s, half_s, {});
    FrameSettings settings;
    settings.spp = render.spp;
    settings.seed = seed;
    settings.frame = image;
    settings.method = render.method;
    settings.max_depth = render.max_depth;
    if (render.budget_rays > 0) {
        settings.budget.kind = FrameBudget::Kind::rays;
        settings.budget.rays = render.budget_rays;
    }
    renderer_.render(poses_, pose, settings, radiance_, &aovs_);
    narpa::expose(camera_, radiance_, seed, image, bytes_, sensor_array_.get());
}

}  // namespace narpa::dataset
