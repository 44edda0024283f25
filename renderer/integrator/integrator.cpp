#include "renderer/integrator/integrator.h"

#include <algorithm>
#include <array>

#include "renderer/integrator/path_integrator.h"
#include "renderer/integrator/sun_direct_lighting.h"

namespace narpa {
namespace {

const SunDirectLighting kSunDirectLighting;
const DirectLighting kDirectLighting;
const PathIntegrator kPathIntegrator;
const SunPathIntegrator kSunPathIntegrator;
const EmissionPathIntegrator kEmissionPathIntegrator;

const Integrator& direct_lighting(const RenderScene& render_scene, bool) {
    if (SunDirectLighting::suffices(render_scene)) return kSunDirectLighting;
    return kDirectLighting;
}

const Integrator& path_tracing(const RenderScene& render_scene, bool separate_sun) {
    if (separate_sun && SunPathIntegrator::suffices(render_scene)) return kSunPathIntegrator;
    if (separate_sun && EmissionPathIntegrator::suffices(render_scene)) return kEmissionPathIntegrator;
    return kPathIntegrator;
}

constexpr std::array<IntegratorKind, 2> kKinds{{
    {RenderSettings::Method::direct, "direct", "light from its sources only", direct_lighting},
    {RenderSettings::Method::path, "path", "all light", path_tracing},
}};

}  // namespace

std::span<const IntegratorKind> integrator_kinds() noexcept {
    return kKinds;
}

const IntegratorKind& integrator_kind(RenderSettings::Method method) noexcept {
    const auto* const kind = std::ranges::find(kKinds, method, &IntegratorKind::method);
    assert(kind != kKinds.end());
    return *kind;
}

}  // namespace narpa
