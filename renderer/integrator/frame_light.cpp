#include "renderer/integrator/frame_light.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/each_isa.h"
#include "renderer/integrator/shading.h"
#include "renderer/light/lights.h"
#include "renderer/light/small_body_sampling.h"

namespace narpa {
namespace {

/// Part of the paths that set out where edges are what counts: in frames of one sample a pixel, and where paths
/// follow all samples.
constexpr float kSomeSetOut = 0.5f;

/// What the rays see, lane by lane: Lambert's and Phong's materials, which take most of a scene.
struct SurfacesSeen {
    RgbLanes diffuse, specular, emission;
    Lanes<float> exponent;
    Vec3Lanes normal;
    std::uint32_t lanes = 0;   ///< those that are set
    std::uint32_t shiny = 0;   ///< of them those with a lobe
    std::uint32_t others = 0;  ///< hits on materials of other kinds
};

/// Sunlight that goes back along each ray from where nothing shades it.
struct Sunlight {
    RgbLanes radiance;
    std::uint32_t lanes = 0;  ///< where there is any
};

Surface surface_seen(const Frame& f, const Packet& p, std::size_t i) {
    return surface_at(f.tracer, f.at, p.hits[i], p.rays.direction[i], p.hits.range_m[i] * f.path.pixel_angle_rad);
}

bool has_textures(const Material& m) {
    return m.texture >= 0 || m.emission_texture >= 0 || m.normal_texture >= 0 || m.height_texture >= 0;
}

void put(SurfacesSeen& seen, std::size_t i, const Rgb& diffuse, const Rgb& specular, const Rgb& emission,
         float exponent) {
    seen.diffuse.put(i, diffuse);
    seen.specular.put(i, specular);
    seen.emission.put(i, emission);
    seen.exponent[i] = exponent;
}

void fill(SurfacesSeen& seen, const Material& m, const Rgb& specular) {
    seen.diffuse.fill(m.diffuse);
    seen.specular.fill(specular);
    seen.emission.fill(m.emission);
    seen.exponent.fill(m.exponent);
}

/// Material by material, of which a packet seldom sees more than two.
void look_at_surfaces(const Frame& f, const Packet& p, SurfacesSeen& seen) {
    const Scene& scene = f.tracer.scene();
    fill(seen, kPlainMaterial, {});
    seen.normal = p.hits.shading_normal;
    for (std::uint32_t left = p.hits.met; left != 0;) {
        const int material = p.hits.material[static_cast<std::size_t>(std::countr_zero(left))];
        std::uint32_t same = 0;
        for (std::size_t i = 0; i < kLanes; ++i)
            same |= static_cast<std::uint32_t>(p.hits.material[i] == material) << i;
        same &= left;
        const bool alone = same == p.hits.met;
        left &= ~same;
        const Material& m = scene.materials[static_cast<std::size_t>(material)];
        if (m.kind > Material::Kind::phong) {
            seen.others |= same;
            continue;
        }
        const Rgb specular = m.kind == Material::Kind::lambert ? Rgb{} : m.specular;
        seen.lanes |= same;
        if (specular != Rgb{}) seen.shiny |= same;
        if (has_textures(m)) {
            for (std::uint32_t rest = same; rest != 0; rest &= rest - 1) {
                const auto i = static_cast<std::size_t>(std::countr_zero(rest));
                const Surface s = surface_seen(f, p, i);
                put(seen, i, s.diffuse, s.specular, s.emission, s.exponent);
                seen.normal.put(i, s.normal);
            }
        } else if (alone) {
            fill(seen, m, specular);
        } else {
            for (std::uint32_t rest = same; rest != 0; rest &= rest - 1)
                put(seen, static_cast<std::size_t>(std::countr_zero(rest)), m.diffuse, specular, m.emission,
                    m.exponent);
        }
    }
}

/// Emission and ambient light, of the lanes that see something.
NARPA_EACH_ISA void shine(const SurfacesSeen& seen, const Rgb& ambient, RgbLanes& radiance) noexcept {
    RgbLanes out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        out.r[i] = seen.emission.r[i] + ambient.x * (seen.diffuse.r[i] + seen.specular.r[i]);
        out.g[i] = seen.emission.g[i] + ambient.y * (seen.diffuse.g[i] + seen.specular.g[i]);
        out.b[i] = seen.emission.b[i] + ambient.z * (seen.diffuse.b[i] + seen.specular.b[i]);
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool is = (seen.lanes >> i & 1u) != 0;
        out.r[i] = is ? out.r[i] : 0;
        out.g[i] = is ? out.g[i] : 0;
        out.b[i] = is ? out.b[i] : 0;
    }
    radiance = out;
}

/// Phong's lobe about the mirror direction, as bsdf.h has it, without its colour; 0 where the material has none.
void lobes_of(const SurfacesSeen& seen, const Lanes<double>& r_v, Lanes<float>& lobe) noexcept {
    for (std::size_t i = 0; i < kLanes; ++i) {
        const double power =
            unit_power(std::min(std::max(r_v[i], 1e-300), 1.0), static_cast<double>(seen.exponent[i]));
        const float scale = (seen.exponent[i] + 2) * 0.5f * static_cast<float>(std::numbers::inv_pi);
        lobe[i] = r_v[i] > 0 ? scale * static_cast<float>(power) : 0;
    }
}

NARPA_EACH_ISA void reflect_sun(const SurfacesSeen& seen, const Vec3Lanes& direction, const Vec3Lanes& to_sun,
                                const Vec3& centre, float irradiance, Sunlight& out) noexcept {
    constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);
    const Vec3Lanes& n = seen.normal;
    Lanes<double> r_v;
    Lanes<float> arriving, lobe{};
    Lanes<std::uint32_t> faces;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const double n_l = n.x[i] * to_sun.x[i] + n.y[i] * to_sun.y[i] + n.z[i] * to_sun.z[i];
        const double n_v = -(n.x[i] * direction.x[i] + n.y[i] * direction.y[i] + n.z[i] * direction.z[i]);
        const double l_v =
            -(to_sun.x[i] * direction.x[i] + to_sun.y[i] * direction.y[i] + to_sun.z[i] * direction.z[i]);
        const double as_centre = to_sun.x[i] * centre.x + to_sun.y[i] * centre.y + to_sun.z[i] * centre.z;
        r_v[i] = 2 * n_l * n_v - l_v;
        // The disc is sampled evenly as it faces.
        arriving[i] = irradiance * static_cast<float>(n_l / as_centre);
        faces[i] = static_cast<std::uint32_t>(n_l > 0) & static_cast<std::uint32_t>(n_v > 0);
    }
    if (seen.shiny != 0) lobes_of(seen, r_v, lobe);
    RgbLanes reflected;
    Lanes<std::uint32_t> sent;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const float r = seen.diffuse.r[i] * kInvPi + seen.specular.r[i] * lobe[i];
        const float g = seen.diffuse.g[i] * kInvPi + seen.specular.g[i] * lobe[i];
        const float b = seen.diffuse.b[i] * kInvPi + seen.specular.b[i] * lobe[i];
        const bool dark = (r == 0) & (g == 0) & (b == 0);
        sent[i] = dark ? 0 : faces[i];
        reflected.r[i] = r * arriving[i];
        reflected.g[i] = g * arriving[i];
        reflected.b[i] = b * arriving[i];
    }
    std::uint32_t lanes = 0;
    for (std::size_t i = 0; i < kLanes; ++i) lanes |= sent[i] << i;
    out.radiance = reflected;
    out.lanes = lanes & seen.lanes;
}

/// The same for one ray that meets a material of another kind.
void light_other(const Frame& f, const Packet& p, std::size_t i, RgbLanes& radiance, Sunlight& sunlight) {
    const Surface surface = surface_seen(f, p, i);
    radiance.put(i, surface.emission + f.tracer.scene().ambient * ambient_reflectance(surface));
    if (!f.sun) return;
    const double cosine = dot(surface.normal, p.to_sun[i]);
    if (cosine <= 0) return;
    const Rgb reflected = bsdf(surface, surface.normal, p.to_sun[i], -p.rays.direction[i]);
    if (reflected == Rgb{}) return;
    const double projected = cosine / dot(p.to_sun[i], f.sun->centre());
    sunlight.radiance.put(i, reflected * (f.sun->irradiance() * static_cast<float>(projected)));
    sunlight.lanes |= 1u << i;
}

/// Adds it where `lit`.
NARPA_EACH_ISA void add_sunlight(const Sunlight& sunlight, std::uint32_t lit, RgbLanes& radiance) noexcept {
    RgbLanes out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool is = (lit >> i & 1u) != 0;
        out.r[i] = radiance.r[i] + (is ? sunlight.radiance.r[i] : 0);
        out.g[i] = radiance.g[i] + (is ? sunlight.radiance.g[i] : 0);
        out.b[i] = radiance.b[i] + (is ? sunlight.radiance.b[i] : 0);
    }
    radiance = out;
}

/// Of the lanes seen.
void add_sun(const Frame& f, Packet& p, Sunlight& sunlight, PhaseClock& clock, RgbLanes& radiance) {
    clock.ends(Phase::shading);
    if (sunlight.lanes == 0) return;
    p.lit = sunlight.lanes & ~f.tracer.occluded(f.at, p.hits, p.to_sun, sunlight.lanes);
    p.rays_traced += static_cast<std::uint64_t>(std::popcount(sunlight.lanes));
    clock.ends(Phase::shadow_rays);
    if (p.lit != 0) add_sunlight(sunlight, p.lit, radiance);
}

/// Only light that comes straight from its source counts.
void direct_light(const Frame& f, Packet& p, RgbLanes& radiance) {
    p.lit = 0;
    if (p.hits.met == 0) {
        radiance.fill({});
        return;
    }
    PhaseClock clock(p.times);
    SurfacesSeen seen;
    Sunlight sunlight;
    look_at_surfaces(f, p, seen);
    shine(seen, f.tracer.scene().ambient, radiance);
    if (f.sun && seen.lanes != 0)
        reflect_sun(seen, p.rays.direction, p.to_sun, f.sun->centre(), f.sun->irradiance(), sunlight);
    for (std::uint32_t rest = seen.others; rest != 0; rest &= rest - 1)
        light_other(f, p, static_cast<std::size_t>(std::countr_zero(rest)), radiance, sunlight);
    add_sun(f, p, sunlight, clock, radiance);
}

/// Flat faces without too sharp a lobe, to which the Sun's light comes by its own points alone.
NARPA_EACH_ISA std::uint32_t lit_by_sun_alone(const HitBatch& hits, const SurfacesSeen& seen) noexcept {
    const Vec3Lanes &flat = hits.geometric_normal, &n = seen.normal;
    Lanes<int> are;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool same = (flat.x[i] == n.x[i]) & (flat.y[i] == n.y[i]) & (flat.z[i] == n.z[i]);
        are[i] = -static_cast<int>(same & (seen.exponent[i] <= kSharpLobe));
    }
    return bits_of(are) & seen.lanes;
}

/// The Sun's light and emission of first surfaces, where it is as simple as in direct light.
void light_first_surfaces(const Frame& f, Packet& p, RgbLanes& radiance) {
    PhaseClock clock(p.times);
    SurfacesSeen seen;
    Sunlight sunlight;
    look_at_surfaces(f, p, seen);
    seen.lanes = lit_by_sun_alone(p.hits, seen);
    if (seen.lanes == 0) return;
    p.first.lit = seen.lanes;
    p.first.diffuse = seen.diffuse;
    p.first.specular = seen.specular;
    shine(seen, {}, radiance);
    reflect_sun(seen, p.rays.direction, p.to_sun, f.sun->centre(), f.sun->irradiance(), sunlight);
    add_sun(f, p, sunlight, clock, radiance);
}

/// All that is known without a path, where the Sun comes first.
void first_light(const Frame& f, Packet& p, RgbLanes& radiance) {
    p.lit = p.first.lit = 0;
    radiance.fill({});
    if (!f.sun_first) return;
    if (p.hits.met != 0) light_first_surfaces(f, p, radiance);
    for_each_lane(lanes_below(p.rays.n) & ~p.hits.met,
                  [&](std::size_t i) { radiance.put(i, sky_along(f.render_scene, p.rays.direction[i])); });
}

/// A sample of a pixel.
struct SamplePlace {
    std::uint8_t packet, lane;
};

/// By paths that share what they find, of one sample of each of some pixels.
void light_together(const Frame& f, std::span<Packet> packets, std::span<const SamplePlace> places,
                    std::span<PacketLight> light) {
    std::array<SamplePlace, kSharing> from;
    std::array<FirstSurface, kSharing> first;
    std::array<Rgb, kSharing> radiance;
    std::array<float, kSharing> variance;
    std::size_t n = 0;
    // As on a chessboard, first one colour, then the other: those that share are to lie between one another.
    for (std::size_t colour = 0; colour < 2; ++colour)
        for (std::size_t i = 0; i < places.size(); ++i) {
            if (((i ^ i >> 2) & 1) != colour) continue;
            const auto [packet, lane] = places[i];
            const Packet& p = packets[packet];
            if (f.sun_first && !is_set(p.hits.met, lane)) continue;
            from[n] = places[i];
            first[n++] = {&p.rays,
                          &p.hits,
                          &p.first,
                          lane,
                          p.number[lane],
                          p.sample[lane],
                          light[packet].first[lane] != Rgb{}};
        }
    const std::uint64_t rays =
        shared_path_radiance(f.render_scene, f.at, f.path, std::span(first).first(n), f.settings.seed,
                             f.settings.frame, std::span(radiance).first(n), std::span(variance).first(n));
    packets.front().rays_traced += rays;
    packets.front().path_rays += rays;
    for (std::size_t i = 0; i < n; ++i) {
        light[from[i].packet].by_paths.put(from[i].lane, radiance[i]);
        packets[from[i].packet].variance[from[i].lane] = variance[i];
    }
}

}  // namespace

Frame make_frame(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                 const Rigid3& T_world_camera, const FrameSettings& settings) {
    const Tracer& tracer = render_scene.tracer();
    const Scene& scene = render_scene.scene();
    const bool direct = settings.method == RenderSettings::Method::direct;
    // One sample passes the lens at its centre, as through a pinhole.
    const bool blurred = settings.spp > 1 && camera.lens && camera.lens->aperture_diameter_m > 0;
    const Lens* const lens = blurred ? &*camera.lens : nullptr;
    const bool guided = !direct && SmallBodySampling::may_help(tracer, at);
    const bool sun_first = !direct && sun_alone_lights_first_surfaces(render_scene) && !guided;
    return {render_scene,
            tracer,
            at,
            camera,
            T_world_camera,
            settings,
            lens,
            scene.sun ? std::optional<SunDisc>(*scene.sun) : std::nullopt,
            direct && !render_scene.lights().beyond_the_sun(),
            sun_first,
            {settings.max_depth, 1 / (camera.fx * std::sqrt(settings.spp)), direct, guided,
             sun_first && settings.spp > 1 ? 1 : kSomeSetOut},
            SubpixelBodies(tracer, at, camera, T_world_camera, lens)};
}

void light_along(const Frame& f, Packet& p, RgbLanes& radiance) {
    if (f.quick) {
        direct_light(f, p, radiance);
        return;
    }
    PhaseClock clock(p.times);
    Lanes<Ray> rays;
    Lanes<Hit> hits;
    Lanes<Rgb> light;
    for (std::size_t i = 0; i < p.rays.n; ++i) rays[i] = p.rays[i], hits[i] = p.hits[i];
    p.rays_traced += path_radiance(f.render_scene, f.at, f.path, std::span(rays).first(p.rays.n),
                                   std::span(hits).first(p.rays.n),
                                   {f.settings.seed, f.settings.frame, std::span(p.number).first(p.rays.n),
                                    std::span(p.sample).first(p.rays.n)},
                                   std::span(light).first(p.rays.n));
    for (std::size_t i = 0; i < p.rays.n; ++i) radiance.put(i, light[i]);
    clock.ends(Phase::indirect);
}

void light_along(const Frame& f, std::span<Packet> packets, std::span<PacketLight> light) {
    if (f.quick) {
        for (std::size_t k = 0; k < packets.size(); ++k) direct_light(f, packets[k], light[k].first);
        return;
    }
    for (std::size_t k = 0; k < packets.size(); ++k) {
        first_light(f, packets[k], light[k].first);
        light[k].by_paths.fill({});
        packets[k].variance.fill(0);
    }
    if (packets.empty()) return;
    PhaseClock clock(packets.front().times);
    // One sample of each pixel together, then the next of each: those of a pixel stay independent.
    std::array<std::array<SamplePlace, kSharing>, kOfAPixel> places;
    std::array<std::size_t, kOfAPixel> n{};
    std::size_t rank = 0;
    std::uint32_t pixel = std::numeric_limits<std::uint32_t>::max();
    for (std::size_t k = 0; k < packets.size(); ++k)
        for_each_lane(packets[k].by_paths & lanes_below(packets[k].rays.n), [&](std::size_t i) {
            rank = packets[k].number[i] == pixel ? rank + 1 : 0;
            pixel = packets[k].number[i];
            places[rank][n[rank]++] = {static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(i)};
        });
    for (std::size_t r = 0; r < kOfAPixel && n[r] > 0; ++r)
        light_together(f, packets, std::span(places[r]).first(n[r]), light);
    clock.ends(Phase::indirect);
}

}  // namespace narpa
