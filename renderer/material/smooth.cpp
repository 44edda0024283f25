// Mirror and clear dielectric: delta distributions.
#include "renderer/material/fresnel.h"
#include "renderer/material/lobes.h"

namespace narpa::lobes {

BsdfSample mirror_sample(const Surface& s, const Vec3& n, const Vec3& v) noexcept {
    BsdfSample sample;
    sample.l = reflect(-v, n);
    sample.weight = s.material->specular;
    sample.specular = true;
    return sample;
}

// Refraction preserves radiance / n^2 (E. Veach 1997, section 5.2): towards the viewer's side the radiance is
// multiplied by (n_viewer / n_beyond)^2, which cancels between entering and leaving a body.
BsdfSample dielectric_sample(const Surface& s, const Vec3& n, const Vec3& v, double choice) noexcept {
    const Material& m = *s.material;
    const double ior = static_cast<double>(m.ior), eta = s.outside ? ior : 1 / ior,
                 cos_i = std::min(1.0, dot(n, v));
    const double reflected = m.schlick ? fresnel_schlick(cos_i, eta) : fresnel_dielectric(cos_i, eta);
    BsdfSample sample;
    sample.specular = true;
    if (choice < reflected) {
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

}  // namespace narpa::lobes
