#include <cmath>

#include "renderer/integrator/integrator.h"
#include "renderer/light/small_body_sampling.h"

namespace narpa {
namespace {

/// PathSettings::first_survival if edges cause most of the error: in frames of one sample per pixel, and if paths
/// are traced from all samples.
constexpr float kReducedSurvival = 0.5f;

const SunDirectLighting kSunDirectLighting;
const DirectIntegrator kDirectIntegrator;
const PathIntegrator kPathIntegrator;

}  // namespace

Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera, const CameraPose& pose,
                 const FrameSettings& settings) {
    const Tracer& tracer = render_scene.tracer();
    const Scene& scene = render_scene.scene();
    const bool direct = settings.method == RenderSettings::Method::direct;
    // A single sample passes the lens at its centre, as through a pinhole.
    const bool blurred = settings.spp > 1 && camera.lens && camera.lens->aperture_diameter_m > 0;
    const Lens* const lens = blurred ? &*camera.lens : nullptr;
    const Mechanisms& on = settings.mechanisms;
    const bool over_time = pose.over_time() && (pose.moves() || at.moving());
    // Paths at different times see moving bodies at different places.
    const bool reuse = on.path_reuse && !(over_time && at.moving());
    const bool small_bodies = !direct && on.small_body_sampling && SmallBodySampling::may_help(tracer, at);
    const bool sun_only = direct && SunDirectLighting::suffices(render_scene);
    const bool separate_sun = !direct && on.separate_sun && sun_alone_lights_first_surfaces(render_scene);
    const Integrator& by_waves = direct ? static_cast<const Integrator&>(kDirectIntegrator) : kPathIntegrator;
    const CameraModel* const model = camera.model.get();
    return {render_scene,
            tracer,
            at,
            camera,
            pose,
            pose.middle(),
            over_time,
            settings,
            model,
            lens,
            scene.sun ? std::optional<SunDisc>(*scene.sun) : std::nullopt,
            sun_only ? kSunDirectLighting : by_waves,
            sun_only,
            separate_sun,
            {settings.max_depth, 1 / (model->pixels_per_radian() * std::sqrt(settings.spp)), direct, small_bodies,
             separate_sun && settings.spp > 1 ? 1 : kReducedSurvival, reuse},
            SubpixelBodies(tracer, at, camera, model, pose.middle(), lens, over_time)};
}

}  // namespace narpa
