#include "renderer/film/first_hit.h"

#include "base/constants.h"
#include "renderer/integrator/shading.h"

namespace narpa {
namespace {

/// What the surface does to the colour of light at first sight.
Rgb base_colour(const Surface& s) {
    switch (s.material->kind) {
        case Material::Kind::mirror: return s.specular;
        case Material::Kind::dielectric: return {1, 1, 1};
        default: return s.diffuse;
    }
}

}  // namespace

void resize(Aovs& a, std::size_t n) {
    a.range_m.resize(n);
    a.depth_m.resize(n);
    a.position.resize(n);
    a.normal.resize(n);
    a.body.resize(n);
    a.albedo.resize(n);
    a.variance.resize(n);
}

void store_first_hit(const Frame& f, const Ray& ray, const Hit& hit, std::size_t pixel, Aovs& aovs) {
    const bool seen = hit.body >= 0;
    aovs.body[pixel] = hit.body;
    aovs.range_m[pixel] = seen ? hit.range_m : kInfinity;
    const Vec3 axis = f.pose.at(ray.time).q * Vec3{0, 0, 1};
    aovs.depth_m[pixel] = seen ? hit.range_m * dot(ray.direction, axis) : kInfinity;
    aovs.position[pixel] = seen ? hit.position : Vec3{};
    aovs.normal[pixel] = seen ? hit.shading_normal : Vec3{};
    aovs.variance[pixel] = 0;
    aovs.albedo[pixel] = {};
    if (seen)
        aovs.albedo[pixel] =
            base_colour(surface_at(f.tracer, f.at, hit, ray.direction, hit.range_m / f.model->pixels_per_radian()));
}

}  // namespace narpa
