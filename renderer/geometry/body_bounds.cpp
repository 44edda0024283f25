#include "renderer/geometry/body_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace narpa {

namespace {

BodyBounds bounds_of_mesh(const Mesh& mesh) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    Vec3 low{kInfinity, kInfinity, kInfinity}, high = -low;
    const auto for_each_vertex = [&](const auto& f) {
        for (const auto& face : mesh.faces)
            for (const std::uint32_t vertex : face) f(vec_cast<double>(mesh.positions[vertex]));
    };
    for_each_vertex([&](const Vec3& p) {
        for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
    });
    if (mesh.faces.empty()) return {{}, {}};
    BodyBounds b{0.5 * (low + high), 0.5 * (high - low)};
    const double largest = std::max({b.semi_axes_m.x, b.semi_axes_m.y, b.semi_axes_m.z});
    for (int k = 0; k < 3; ++k) b.semi_axes_m[k] = std::max(b.semi_axes_m[k], 1e-3 * largest);
    double farthest2 = 0;  // at most 3, at a corner of the box
    for_each_vertex([&](const Vec3& p) {
        const Vec3 unit = (p - b.centre_m) / b.semi_axes_m;
        farthest2 = std::max(farthest2, dot(unit, unit));
    });
    b.semi_axes_m *= std::sqrt(farthest2) * (1 + 1e-9);
    return b;
}

}  // namespace

BodyBounds bounds_of(const Scene& scene, const Body& body) {
    if (const Sphere* sphere = std::get_if<Sphere>(&body.shape))
        return {{}, {sphere->radius_m, sphere->radius_m, sphere->radius_m}};
    if (const Ellipsoid* ellipsoid = std::get_if<Ellipsoid>(&body.shape)) return {{}, ellipsoid->semi_axes_m};
    return bounds_of_mesh(scene.meshes[static_cast<std::size_t>(std::get<int>(body.shape))]);
}

}  // namespace narpa
