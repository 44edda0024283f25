#include "renderer/material/bsdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace narpa {
namespace {

constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);

}  // namespace

Rgb bsdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept {
    const double n_l = dot(n, l);
    if (n_l <= 0 || dot(n, v) <= 0) return {};
    Rgb f = s.diffuse * kInvPi;
    if (s.specular == Rgb{}) return f;
    const double r_v = 2 * n_l * dot(n, v) - dot(l, v);
    if (r_v <= 0) return f;
    const float lobe = (s.exponent + 2) * 0.5f * kInvPi * std::pow(static_cast<float>(r_v), s.exponent);
    return f + s.specular * lobe;
}

Rgb ambient_reflectance(const Surface& s) noexcept {
    return s.diffuse + s.specular;
}

}  // namespace narpa
