// Dispatch on the kinds of BSDF, through their rows.
#include "renderer/material/bsdf.h"

#include <algorithm>
#include <cassert>
#include <numbers>

#include "renderer/material/bsdf_kind.h"
#include "renderer/material/directions.h"

namespace narpa {
namespace {

constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);
/// Lower densities occur only by rounding, and could overflow the weight.
constexpr double kMinDensity = 1e-30;

double cosine_pdf(double n_l) noexcept {
    return n_l * std::numbers::inv_pi;
}

BsdfSample lambert_sample(const Surface& s, const Vec3& n, const Random3& u) noexcept {
    BsdfSample sample;
    sample.l = cosine_direction(n, u[1], u[2]);
    sample.pdf = cosine_pdf(std::max(0.0, dot(n, sample.l)));
    sample.weight = s.diffuse;
    return sample;
}

}  // namespace

// Lambert's is the most common kind: it is not called through its row.

Rgb bsdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept {
    const BsdfKind* const kind = s.material->kind;
    const double n_l = dot(n, l), n_v = dot(n, v);
    if (n_l <= 0 || n_v <= 0) return {};
    if (kind == &kinds::lambert) return s.diffuse * kInvPi;
    return kind->is_delta ? Rgb{} : kind->f(s, {n, l, v, n_l, n_v, dot(l, v)});
}

double bsdf_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept {
    const BsdfKind* const kind = s.material->kind;
    const double n_l = dot(n, l), n_v = dot(n, v);
    if (n_l <= 0 || n_v <= 0 || kind->is_delta) return 0;
    return kind->pdf == nullptr ? cosine_pdf(n_l) : kind->pdf(s, {n, l, v, n_l, n_v, dot(l, v)});
}

BsdfSample sample_bsdf(const Surface& s, const Vec3& n, const Vec3& v, const std::array<double, 3>& u) noexcept {
    assert(u[0] >= 0 && u[0] < 1 && u[1] >= 0 && u[1] < 1 && u[2] >= 0 && u[2] < 1);
    const BsdfKind* const kind = s.material->kind;
    if (dot(n, v) <= 0) return {};
    if (kind == &kinds::lambert) return lambert_sample(s, n, u);
    if (kind->sample != nullptr) return kind->sample(s, n, v, u);
    BsdfSample sample;
    sample.l = kind->direction == nullptr ? cosine_direction(n, u[1], u[2]) : kind->direction(s, n, v, u);
    sample.pdf = bsdf_pdf(s, n, sample.l, v);
    if (sample.pdf > kMinDensity)
        sample.weight = bsdf(s, n, sample.l, v) * static_cast<float>(dot(n, sample.l) / sample.pdf);
    return sample;
}

bool is_specular(const Material& m) noexcept {
    return m.kind->is_delta;
}

bool is_lambert_or_phong(const Material& m) noexcept {
    return m.kind->lambert_or_phong;
}

Rgb lobe_colour(const Material& m) noexcept {
    return m.kind->has_lobe ? m.specular : Rgb{};
}

Rgb ambient_reflectance(const Surface& s) noexcept {
    const BsdfKind* const kind = s.material->kind;
    return kind->lambert_or_phong ? s.diffuse + s.specular : kind->ambient(s);
}

}  // namespace narpa
