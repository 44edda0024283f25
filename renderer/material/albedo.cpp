#include "renderer/material/albedo.h"

#include <algorithm>
#include <limits>
#include <numbers>

#include "renderer/material/directions.h"
#include "renderer/material/regolith.h"

namespace narpa {

Rgb directional_albedo(const Surface& s, double mu, int steps) noexcept {
    const Vec3 n{0, 0, 1}, v = direction_at(mu, 0);
    Vec3 sum{};
    for (int i = 0; i < steps; ++i)
        for (int j = 0; j < steps; ++j) {
            // f is even in the azimuth. Points are dense towards the horizon and towards v; the Jacobian
            // compensates.
            const double t = (i + 0.5) / steps, u = (j + 0.5) / steps;
            const Vec3 l = direction_at(t * t, 0.5 * u * u);
            sum += vec_cast<double>(bsdf(s, n, l, v)) * (4 * t * t * t * 2 * u);
        }
    return vec_cast<float>(sum * (std::numbers::pi / (static_cast<double>(steps) * steps)));
}

Rgb largest_albedo(const Material& m) noexcept {
    using Kind = Material::Kind;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    switch (m.kind) {
        case Kind::lambert: return m.diffuse;
        case Kind::phong: return m.diffuse + m.specular;
        case Kind::phong_classic: return {kInfinity, kInfinity, kInfinity};
        case Kind::mirror: return m.specular;
        case Kind::dielectric: return {1, 1, 1};
        case Kind::ggx: {
            const auto bound = [](float base) { return std::max(base, 1.0f); };
            return {bound(m.diffuse.x), bound(m.diffuse.y), bound(m.diffuse.z)};
        }
        case Kind::lunar_lambert: return m.diffuse * static_cast<float>(kLunarLambertLargest);
        case Kind::lommel_seeliger:
        case Kind::hapke: break;
    }
    Surface s;
    s.diffuse = m.diffuse;
    s.material = &m;
    Rgb largest{};
    for (const double mu : {1e-3, 0.01, 0.03, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0}) {
        const Rgb albedo = directional_albedo(s, mu, 64);
        largest = {std::max(largest.x, albedo.x), std::max(largest.y, albedo.y), std::max(largest.z, albedo.z)};
    }
    return largest;
}

}  // namespace narpa
