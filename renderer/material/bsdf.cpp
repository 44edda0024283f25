#include "renderer/material/bsdf.h"

#include <algorithm>

#include "renderer/material/directions.h"
#include "renderer/material/lobes.h"

namespace narpa {
namespace {

constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);
using Kind = Material::Kind;

// Both out of line, so that Lambert's branch does not even save registers for them.

[[gnu::noinline]] Rgb phong_bsdf(const Surface& s, double r_v) noexcept {
    if (r_v <= 0) return s.diffuse * kInvPi;
    const auto power = static_cast<float>(unit_power(std::min(r_v, 1.0), static_cast<double>(s.exponent)));
    const float lobe = (s.exponent + 2) * 0.5f * kInvPi * power;
    return s.diffuse * kInvPi + s.specular * lobe;
}

[[gnu::noinline]] Rgb other_bsdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v, double n_l,
                                 double n_v) noexcept {
    switch (s.material->kind) {
        case Kind::phong_classic: return lobes::phong_classic_f(s, n_l, n_v, dot(l, v));
        case Kind::ggx: return lobes::ggx_f(s, n, l, v);
        case Kind::lommel_seeliger: return lobes::lommel_seeliger_f(s, n_l, n_v, dot(l, v));
        case Kind::lunar_lambert: return lobes::lunar_lambert_f(s, n_l, n_v, dot(l, v));
        case Kind::hapke: return lobes::hapke_f(s, n_l, n_v, dot(l, v));
        default: return {};  // mirror and dielectric
    }
}

Vec3 chosen_direction(const Surface& s, const Vec3& n, const Vec3& v, const std::array<double, 3>& u) noexcept {
    switch (s.material->kind) {
        case Kind::phong: return lobes::phong_direction(s, n, v, u);
        case Kind::lommel_seeliger: return lobes::lommel_seeliger_direction(s, n, v, u);
        case Kind::lunar_lambert: return lobes::lunar_lambert_direction(n, u);
        case Kind::hapke: return lobes::hapke_direction(s, n, v, u);
        default: return cosine_direction(n, u[1], u[2]);
    }
}

}  // namespace

bool is_specular(const Material& m) noexcept {
    return m.kind == Kind::mirror || m.kind == Kind::dielectric;
}

Rgb bsdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept {
    const double n_l = dot(n, l), n_v = dot(n, v);
    if (n_l <= 0 || n_v <= 0) return {};
    if (s.material->kind == Kind::lambert) return s.diffuse * kInvPi;
    if (s.material->kind == Kind::phong) return phong_bsdf(s, 2 * n_l * n_v - dot(l, v));
    return other_bsdf(s, n, l, v, n_l, n_v);
}

double bsdf_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept {
    const double n_l = dot(n, l);
    if (n_l <= 0 || dot(n, v) <= 0 || is_specular(*s.material)) return 0;
    switch (s.material->kind) {
        case Kind::phong: return lobes::phong_pdf(s, n, l, v);
        case Kind::ggx: return lobes::ggx_pdf(s, n, l, v);
        case Kind::lommel_seeliger: return lobes::lommel_seeliger_pdf(s, n, l, v);
        case Kind::lunar_lambert: return lobes::lunar_lambert_pdf(n, l);
        case Kind::hapke: return lobes::hapke_pdf(s, n, l, v);
        default: return n_l * std::numbers::inv_pi;
    }
}

BsdfSample sample_bsdf(const Surface& s, const Vec3& n, const Vec3& v, const std::array<double, 3>& u) noexcept {
    if (dot(n, v) <= 0) return {};
    if (s.material->kind == Kind::mirror) return lobes::mirror_sample(s, n, v);
    if (s.material->kind == Kind::dielectric) return lobes::dielectric_sample(s, n, v, u[0]);
    if (s.material->kind == Kind::ggx) return lobes::ggx_sample(s, n, v, u);
    BsdfSample sample;
    if (s.material->kind == Kind::lambert) {
        sample.l = cosine_direction(n, u[1], u[2]);
        sample.pdf = std::max(0.0, dot(n, sample.l)) * std::numbers::inv_pi;
        sample.weight = s.diffuse;
        return sample;
    }
    sample.l = chosen_direction(s, n, v, u);
    sample.pdf = bsdf_pdf(s, n, sample.l, v);
    if (sample.pdf > lobes::kMinDensity)
        sample.weight = bsdf(s, n, sample.l, v) * static_cast<float>(dot(n, sample.l) / sample.pdf);
    return sample;
}

Rgb other_ambient_reflectance(const Surface& s) noexcept {
    switch (s.material->kind) {
        case Kind::phong_classic: return s.material->ambient;
        case Kind::mirror: return s.material->specular;
        case Kind::ggx: return lobes::ggx_mean_albedo(s);
        case Kind::lommel_seeliger: return lobes::lommel_seeliger_mean_albedo(s);
        case Kind::lunar_lambert: return lobes::lunar_lambert_mean_albedo(s);
        case Kind::hapke: return lobes::hapke_mean_albedo(s);
        default: return {1, 1, 1};  // clear glass loses no light
    }
}

}  // namespace narpa
