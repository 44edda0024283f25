#include "renderer/frame/frame.h"

#include <cassert>
#include <cmath>

#include "renderer/frame/tuning.h"
#include "renderer/light/small_body_sampling.h"

namespace narpa {

Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera, const CameraPose& pose,
                 const FrameSettings& settings) {
    assert(settings.spp >= 1 && settings.max_depth >= 1);
    const Tracer& tracer = render_scene.tracer();
    const bool direct = settings.method == RenderSettings::Method::direct;
    // A single sample passes the lens at its centre, as through a pinhole.
    const bool blurred = settings.spp > 1 && camera.optics.lens && camera.optics.lens->aperture_diameter_m > 0;
    const Lens* const lens = blurred ? &*camera.optics.lens : nullptr;
    const Mechanisms& on = settings.mechanisms;
    const bool over_time = pose.over_time() && (pose.moves() || at.moving());
    const CameraModel* const model = camera.model.get();
    const Integrator& integrator = integrator_kind(settings.method).choose(render_scene, on.separate_sun);
    const LightParts parts = integrator.parts();
    const PathSettings path{
        .max_depth = settings.max_depth,
        .pixel_angle_rad = 1 / (model->pixels_per_radian() * std::sqrt(settings.spp)),
        .direct = direct,
        .small_bodies = !direct && on.small_body_sampling && SmallBodySampling::may_help(tracer, at),
        .first_survival = integrator.thins_paths() && settings.spp > 1 ? 1 : tuning::kReducedSurvival,
        // Paths at different times see moving bodies at different places.
        .reuse = on.path_reuse && !(over_time && at.moving()),
    };
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
            render_scene.lights().sun(),
            integrator,
            parts,
            integrator.thins_paths(),
            {render_scene, at, path, settings.seed, settings.frame},
            SubpixelBodies(tracer, at, camera, model, pose.middle(), lens, over_time)};
}

}  // namespace narpa
