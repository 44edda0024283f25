#include "renderer/lidar/beam_cone.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/each_isa.h"

namespace narpa {
namespace {

NARPA_EACH_ISA void spread(const Vec3& beam, const BeamCone::Across& across, const double* x, const double* y,
                           std::size_t first, std::size_t end, Vec3Lanes& __restrict out) {
    const Vec3 axis = beam, ax = across.x, ay = across.y;
    for (std::size_t i = first; i < end; ++i)
        out.put(i, normalized(axis + (x[i - first] * ax + y[i - first] * ay)));
}

}  // namespace

BeamCone::BeamCone(double divergence_rad, int rays) : x_(static_cast<std::size_t>(rays)), y_(x_) {
    if (rays == 1) return;
    tangent_ = std::tan(0.5 * divergence_rad);
    for (int i = 0; i < rays; ++i) {
        const double radius = tangent_ * std::sqrt((i + 0.5) / rays),
                     turn = 2 * std::numbers::pi * i / std::numbers::phi;
        x_[static_cast<std::size_t>(i)] = radius * std::cos(turn);
        y_[static_cast<std::size_t>(i)] = radius * std::sin(turn);
    }
    spread_the_first();
}

/// After the ray nearest to the axis, each is the one farthest from all before it (Gonzalez 1985).
void BeamCone::spread_the_first() {
    std::vector<double> nearest2(size(), std::numeric_limits<double>::infinity());
    for (std::size_t n = 1; n < size(); ++n) {
        for (std::size_t k = n; k < size(); ++k)
            nearest2[k] = std::min(nearest2[k], std::pow(x_[k] - x_[n - 1], 2) + std::pow(y_[k] - y_[n - 1], 2));
        const auto farthest = static_cast<std::size_t>(
            std::max_element(nearest2.begin() + static_cast<std::ptrdiff_t>(n), nearest2.end()) - nearest2.begin());
        std::swap(x_[n], x_[farthest]), std::swap(y_[n], y_[farthest]);
        std::swap(nearest2[n], nearest2[farthest]);
    }
}

BeamCone::Across BeamCone::across(const Vec3& beam, std::uint32_t turn) noexcept {
    const Vec3 any = std::abs(beam.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    const Vec3 x = normalized(cross(any, beam)), y = cross(beam, x);
    const double angle = 2 * std::numbers::pi * (turn + 0.5) * 0x1p-32, c = std::cos(angle), s = std::sin(angle);
    return {c * x + s * y, c * y - s * x};
}

void BeamCone::append(const Ray& beam, const Across& across, std::size_t n, std::size_t count,
                      RayBatch& rays) const noexcept {
    const std::size_t first = rays.n;
    rays.n += count;
    for (std::size_t i = first; i < rays.n; ++i) rays.put(i, beam);
    if (size() > 1) spread(beam.direction, across, &x_[n], &y_[n], first, rays.n, rays.direction);
}

}  // namespace narpa
