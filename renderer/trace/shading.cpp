#include "renderer/trace/shading.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace narpa {
namespace {

constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);

Rgb texel(const Texture& t, int x, int y) {
    const std::size_t at =
        3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(t.width) + static_cast<std::size_t>(x));
    return Rgb{static_cast<float>(t.rgb[at]), static_cast<float>(t.rgb[at + 1]),
               static_cast<float>(t.rgb[at + 2])} *
           (1.0f / 65535.0f);
}

int wrap(double i, int n) {
    const double w = i - n * std::floor(i / n);
    return std::min(static_cast<int>(w), n - 1);
}

}  // namespace

Rgb texture_lookup(const Texture& texture, float u, float v) noexcept {
    if (texture.width <= 0 || texture.height <= 0 || !std::isfinite(u) || !std::isfinite(v)) return {1, 1, 1};
    const double x = static_cast<double>(u) * texture.width - 0.5;
    const double y = (1 - static_cast<double>(v)) * texture.height - 0.5;
    const double x0 = std::floor(x), y0 = std::floor(y);
    const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
    const int left = wrap(x0, texture.width), right = wrap(x0 + 1, texture.width);
    const int top = wrap(y0, texture.height), bottom = wrap(y0 + 1, texture.height);
    const Rgb upper = texel(texture, left, top) * (1 - fx) + texel(texture, right, top) * fx;
    const Rgb lower = texel(texture, left, bottom) * (1 - fx) + texel(texture, right, bottom) * fx;
    return upper * (1 - fy) + lower * fy;
}

Surface surface_at(const Scene& scene, const Hit& hit) noexcept {
    const Material& m = scene.materials[static_cast<std::size_t>(hit.material)];
    Surface s{m.diffuse, {}, m.emission, m.exponent};
    if (m.kind == Material::Kind::phong) s.specular = m.specular;
    if (m.texture >= 0)
        s.diffuse = s.diffuse * texture_lookup(scene.textures[static_cast<std::size_t>(m.texture)], hit.u, hit.v);
    return s;
}

Rgb brdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept {
    const double n_l = dot(n, l);
    if (n_l <= 0 || dot(n, v) <= 0) return {};
    Rgb f = s.diffuse * kInvPi;
    if (s.specular == Rgb{}) return f;
    const double r_v = 2 * n_l * dot(n, v) - dot(l, v);
    if (r_v <= 0) return f;
    const float lobe = (s.exponent + 2) * 0.5f * kInvPi * std::pow(static_cast<float>(r_v), s.exponent);
    return f + s.specular * lobe;
}

}  // namespace narpa
