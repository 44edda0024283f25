#include "renderer/material/albedo.h"

#include <algorithm>
#include <numbers>

#include "renderer/material/bsdf_kind.h"
#include "renderer/material/directions.h"

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
    if (m.kind->largest_albedo != nullptr) return m.kind->largest_albedo(m);
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
