#include "renderer/lidar/plain_returns.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "base/each_isa.h"
#include "renderer/material/bsdf.h"
#include "renderer/material/phong_lobe.h"
#include "renderer/material/texture/texture_lookup.h"

namespace narpa {
namespace {

struct alignas(64) PlainSurfaces {
    RgbLanes diffuse, specular;
    Lanes<float> exponent, retroreflectance;
    std::uint32_t lanes = 0;  ///< those that are set
    bool shiny = false;       ///< one of them has a specular lobe

    void put(std::size_t i, const Material& m, const Rgb& m_specular) {
        diffuse.put(i, m.diffuse), specular.put(i, m_specular);
        exponent[i] = m.exponent, retroreflectance[i] = m.retroreflectance;
    }
    void fill(const Material& m, const Rgb& m_specular) {
        diffuse.fill(m.diffuse), specular.fill(m_specular);
        exponent.fill(m.exponent), retroreflectance.fill(m.retroreflectance);
    }
};

void look_up_colours(const Tracer& tracer, const Material& m, const HitBatch& hits, std::uint32_t lanes,
                     RgbLanes& diffuse) {
    const Texture& texture = tracer.scene().textures[static_cast<std::size_t>(m.texture)];
    for_each_lane(lanes, [&](std::size_t i) {
        if (!std::isfinite(hits.u[i]) || !std::isfinite(hits.v[i])) return;
        const auto body = static_cast<std::size_t>(hits.body[i]);
        const TextureLayout layout = tracer.shape(body).properties().texture_layout;
        diffuse.put(i, m.diffuse * texture_lookup(texture, hits.u[i], hits.v[i], {}, layout));
    });
}

/// Material by material: a batch rarely meets more than two.
void gather_plain(const Tracer& tracer, const HitBatch& hits, std::uint32_t met, PlainSurfaces& out) {
    out.fill(kPlainMaterial, {});
    for (std::uint32_t left = met; left != 0;) {
        const int material = hits.material[static_cast<std::size_t>(std::countr_zero(left))];
        const std::uint32_t same = lanes_with(hits.material, material) & left;
        left &= ~same;
        const Material& m = tracer.scene().materials[static_cast<std::size_t>(material)];
        if (!is_lambert_or_phong(m) || has_more_than_colour(m)) continue;
        const Rgb specular = lobe_colour(m);
        out.lanes |= same;
        out.shiny |= specular != Rgb{};
        if (same == met)
            out.fill(m, specular);
        else
            for_each_lane(same, [&](std::size_t i) { out.put(i, m, specular); });
        if (m.texture >= 0) look_up_colours(tracer, m, hits, same, out.diffuse);
    }
}

/// pi * BRDF * cosine for light that returns along the incident ray; bit for bit equal to bsdf() (bsdf.h).
NARPA_EACH_ISA void evaluate_backscatter(const PlainSurfaces& surfaces, const Vec3Lanes& normal,
                                         const Vec3Lanes& direction, PlainReturns& __restrict out) noexcept {
    constexpr float inv_pi = static_cast<float>(std::numbers::inv_pi);
    Lanes<double> cosine, r_v;
    Lanes<float> lobe{};
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 back = -direction[i];
        cosine[i] = std::max(dot(normal[i], back), 0.0);  // smooth normals may turn away at the limb
        r_v[i] = 2 * cosine[i] * cosine[i] - dot(back, back);
    }
    if (surfaces.shiny)
        for (std::size_t i = 0; i < kLanes; ++i) lobe[i] = phong_lobe(r_v[i], surfaces.exponent[i]);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const float r = surfaces.diffuse.r[i] * inv_pi + surfaces.specular.r[i] * lobe[i];
        const float g = surfaces.diffuse.g[i] * inv_pi + surfaces.specular.g[i] * lobe[i];
        const float b = surfaces.diffuse.b[i] * inv_pi + surfaces.specular.b[i] * lobe[i];
        const double mean = choose(cosine[i] > 0, static_cast<double>(r + g + b) / 3, 0);
        const double reflectivity = std::numbers::pi * mean + static_cast<double>(surfaces.retroreflectance[i]);
        out.reflectivity[i] = static_cast<float>(cosine[i] * reflectivity);
        out.cos_incidence[i] = static_cast<float>(cosine[i]);
    }
}

}  // namespace

void find_plain_returns(const Tracer& tracer, const RayBatch& rays, const HitBatch& hits, std::uint32_t met,
                        PlainReturns& out) noexcept {
    PlainSurfaces surfaces;
    gather_plain(tracer, hits, met, surfaces);
    out.lanes = surfaces.lanes;
    if (out.lanes != 0) evaluate_backscatter(surfaces, hits.shading_normal, rays.direction, out);
}

}  // namespace narpa
