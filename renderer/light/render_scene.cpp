#include "renderer/light/render_scene.h"

#include "renderer/light/atmosphere.h"
#include "renderer/light/sky_kind.h"

namespace narpa {
namespace {

Status check_light(const Scene& s, const Light& l) {
    if (l.mount >= static_cast<int>(s.bodies.size()))
        return Error{"light \"" + l.name + "\" rides on body " + std::to_string(l.mount) + " of " +
                     std::to_string(s.bodies.size())};
    const bool rectangle = l.kind == Light::Kind::rectangle, disc = l.kind == Light::Kind::disc;
    if ((rectangle && !(l.width_m > 0 && l.height_m > 0)) || (disc && !(l.radius_m > 0)))
        return Error{"light \"" + l.name + "\": the size of a lamp is a positive length in metres"};
    return Ok{};
}

}  // namespace

Result<RenderScene> RenderScene::create(const Scene& scene, int threads,
                                        std::unique_ptr<const Background> background,
                                        std::unique_ptr<const Medium> medium) {
    auto tracer = Tracer::create(scene, threads);
    if (!tracer) return tracer.error();
    for (const Light& l : scene.lights)
        if (const Status good = check_light(scene, l); !good) return good.error();
    if (scene.sky && background == nullptr && medium == nullptr) {
        SkyLight sky = scene.sky->make(scene);
        background = std::move(sky.background), medium = std::move(sky.medium);
    }
    if (scene.atmosphere && medium == nullptr) medium = std::make_unique<AtmosphereMedium>(scene, threads);
    if (background == nullptr) background = std::make_unique<UniformBackground>(scene.ambient);
    return RenderScene(*std::move(tracer), std::move(background), std::move(medium));
}

}  // namespace narpa
