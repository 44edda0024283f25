#include "renderer/integrator/path.h"

#include <algorithm>
#include <array>
#include <variant>

#include "renderer/integrator/wavefront.h"

namespace narpa {

std::uint64_t path_radiance(const RenderScene& render_scene, const BodyPoses& at, const PathSettings& settings,
                            std::span<const Ray> rays, std::span<const Hit> first, const PathNumbers& numbers,
                            std::span<Rgb> radiance) noexcept {
    std::uint64_t traced = 0;
    for (std::size_t k = 0; k < rays.size(); k += kWavefront) {
        const std::size_t n = std::min(kWavefront, rays.size() - k);
        Wavefront wavefront(
            render_scene, at, settings,
            {numbers.seed, numbers.frame, numbers.pixel.subspan(k, n), numbers.sample.subspan(k, n)});
        wavefront.run(rays.subspan(k, n), first.subspan(k, n), radiance.subspan(k, n));
        traced += wavefront.rays_traced();
    }
    return traced;
}

std::uint64_t reused_path_radiance(const RenderScene& render_scene, const BodyPoses& at,
                                   const PathSettings& settings, std::span<const PathStart> starts,
                                   std::uint64_t seed, std::uint32_t frame, std::span<Rgb> radiance,
                                   std::span<float> variance) noexcept {
    if (starts.empty()) return 0;
    std::array<std::uint32_t, kReuseGroup> pixel, sample;
    for (std::size_t i = 0; i < starts.size(); ++i) pixel[i] = starts[i].pixel, sample[i] = starts[i].sample;
    Wavefront wavefront(
        render_scene, at, settings,
        {seed, frame, std::span(pixel).first(starts.size()), std::span(sample).first(starts.size())});
    wavefront.run_reused(starts, radiance, variance);
    return wavefront.rays_traced();
}

bool sun_alone_lights_first_surfaces(const RenderScene& render_scene) noexcept {
    const Lights& lights = render_scene.lights();
    if (lights.any(Lights::Group::all) || lights.any_with_extent() || !lights.sun()) return false;
    if (render_scene.medium() != nullptr || render_scene.background().is_sampled()) return false;
    const Scene& scene = render_scene.scene();
    const auto is_flat = [&](const Body& b) {
        const int* const mesh = std::get_if<int>(&b.shape);
        return mesh == nullptr || scene.meshes[static_cast<std::size_t>(*mesh)].normals.empty();
    };
    if (std::ranges::none_of(scene.bodies, is_flat)) return false;
    return lights.sun()->is_point() || render_scene.scene().sun->angular_diameter_rad < kNarrowSun_rad;
}

Rgb escaped_radiance(const RenderScene& render_scene, const Vec3& direction) noexcept {
    const Rgb background = render_scene.background().radiance(direction);
    const std::optional<SunDisc>& sun = render_scene.lights().sun();
    if (!sun || sun->is_point() || sun->pdf(direction) == 0) return background;
    return background + Rgb{sun->radiance(), sun->radiance(), sun->radiance()};
}

}  // namespace narpa
