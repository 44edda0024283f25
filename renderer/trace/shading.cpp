#include "renderer/trace/shading.h"

#include "renderer/material/texture_lookup.h"

namespace narpa {

Surface surface_at(const Tracer& tracer, const Placement&, const Hit& hit, const Vec3&, double) noexcept {
    const Scene& scene = tracer.scene();
    const Material& m = scene.materials[static_cast<std::size_t>(hit.material)];
    Surface s{m.diffuse, {}, m.emission, m.exponent, &m, hit.shading_normal, hit.outside};
    if (m.kind == Material::Kind::phong) s.specular = m.specular;
    if (m.texture >= 0)
        s.diffuse = s.diffuse * texture_lookup(scene.textures[static_cast<std::size_t>(m.texture)], hit.u, hit.v);
    return s;
}

}  // namespace narpa
