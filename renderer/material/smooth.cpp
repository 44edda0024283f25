// Mirror and clear dielectric: delta distributions.
#include "renderer/keys/toml_reader.h"
#include "renderer/material/fresnel.h"
#include "renderer/material/material_keys.h"

namespace narpa {
namespace {

constexpr TableKey kMirrorRows[]{{"reflectance", rows::rgb(kUnit)}};
constexpr TableKey kDielectricRows[]{{"ior", rows::number({.low = 0.1, .high = 10})}, kFresnelRow};

void read_mirror(TableReader& table, Material& m) {
    m.specular = table.rgb("reflectance").value_or(Rgb{1, 1, 1});
}

BsdfSample mirror_sample(const Surface& s, const Vec3& n, const Vec3& v, const Random3&) noexcept {
    BsdfSample sample;
    sample.l = reflect(-v, n);
    sample.weight = s.material->specular;
    sample.specular = true;
    return sample;
}

// Refraction preserves radiance / n^2 (E. Veach 1997, section 5.2): towards the viewer's side the radiance is
// multiplied by (n_viewer / n_beyond)^2, which cancels between entering and leaving a body.
BsdfSample dielectric_sample(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept {
    const Material& m = *s.material;
    const double ior = static_cast<double>(m.ior), eta = s.outside ? ior : 1 / ior,
                 cos_i = std::min(1.0, dot(n, v));
    const double reflected = m.schlick ? fresnel_schlick(cos_i, eta) : fresnel_dielectric(cos_i, eta);
    BsdfSample sample;
    sample.specular = true;
    if (u[0] < reflected) {
        sample.l = reflect(-v, n);
        sample.weight = {1, 1, 1};
        return sample;
    }
    sample.l = refract(-v, n, eta, refracted_cosine(cos_i, eta));
    sample.transmitted = true;
    sample.radiance_scale = static_cast<float>(1 / (eta * eta));
    sample.weight = Rgb{1, 1, 1} * sample.radiance_scale;
    return sample;
}

}  // namespace

constinit const BsdfKind kinds::mirror{.name = "mirror",
                                       .keys = kMirrorRows,
                                       .read = read_mirror,
                                       .has_lobe = true,
                                       .is_delta = true,
                                       .is_mirror = true,
                                       .sample = mirror_sample,
                                       .ambient = [](const Surface& s) noexcept { return s.material->specular; },
                                       .largest_albedo = [](const Material& m) noexcept { return m.specular; }};

constinit const BsdfKind kinds::dielectric{.name = "dielectric",
                                           .keys = kDielectricRows,
                                           .read = read_fresnel,
                                           .is_delta = true,
                                           .sample = dielectric_sample,
                                           .ambient =
                                               [](const Surface&) noexcept {
                                                   return Rgb{1, 1, 1};
                                               },  // clear glass loses no light
                                           .largest_albedo =
                                               [](const Material&) noexcept {
                                                   return Rgb{1, 1, 1};
                                               }};

}  // namespace narpa
