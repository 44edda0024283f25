#include "renderer/atmosphere/ray_bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace narpa {
namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();
/// Bundles of fewer rays are not worth the corners.
constexpr std::size_t kFewest = 12;
constexpr int kMostDivisions = 1;
/// Ends below this height above the ground, and not too far below the ground, count as there.
constexpr double kNearGround_m = 10'000, kMostBelowGround_m = 500;
/// Densities of aerosol at the ends that differ by less, as parts of that on the ground, are one.
constexpr double kLevel = 1e-3;
/// Of the brightest band, and of what passes a vacuum: what is fainter need not agree as well.
constexpr float kFaintest = 1e-3f;

bool agree(const Rgb& a, const Rgb& b, float tolerance, float floor) noexcept {
    for (int band = 0; band < 3; ++band)
        if (std::abs(a[band] - b[band]) > tolerance * (std::abs(b[band]) + floor)) return false;
    return true;
}

float brightest(const Rgb& light) noexcept {
    return std::max({light.x, light.y, light.z});
}

}  // namespace

AirLight air_along(const ScatteredLight& light, const Vec3& origin, const Vec3& direction, double range_m,
                   const Vec3* to_sun) noexcept {
    const Air& air = light.air();
    if (to_sun == nullptr) return {transmittance_of(air, light.columns(origin, direction, range_m)), {}};
    const ScatteredLight::Segment s = light.along(origin, direction, range_m, *to_sun);
    return {transmittance_of(air, s.columns), bands_of(air, s.in_scattering)};
}

/// Values on a grid over a box, 0 to 1 in each dimension: linear across, linear or quadratic upright, linear in
/// density.
struct RayBundle::Grid {
    std::size_t n_upright = 2, n_density = 1;
    std::array<std::array<std::array<AirLight, 2>, 3>, 2> value;  ///< [density][upright][across]

    [[nodiscard]] AirLight at(const Place& share) const noexcept {
        const auto u = static_cast<float>(share[0]), v = static_cast<float>(share[1]),
                   w = static_cast<float>(share[2]);
        const std::array<float, 2> across{1 - u, u}, density{n_density == 2 ? 1 - w : 1, w};
        const std::array<float, 3> upright =
            n_upright == 2 ? std::array{1 - v, v, 0.0f}
                           : std::array{(1 - v) * (1 - 2 * v), 4 * v * (1 - v), v * (2 * v - 1)};
        AirLight sum{{}, {}};
        for (std::size_t i = 0; i < n_density; ++i)
            for (std::size_t j = 0; j < n_upright; ++j)
                for (std::size_t k = 0; k < 2; ++k) {
                    const float weight = density[i] * upright[j] * across[k];
                    sum.transmittance += weight * value[i][j][k].transmittance;
                    sum.in_scattering += weight * value[i][j][k].in_scattering;
                }
        return sum;
    }
};

RayBundle::RayBundle(const ScatteredLight& light, const Vec3& origin, const Vec3* to_sun, float tolerance) noexcept
    : light_(light), origin_(origin), to_sun_(to_sun), tolerance_(tolerance) {}

void RayBundle::trace(std::span<const Ray> rays, std::span<AirLight> out) noexcept {
    rays_ = rays, out_ = out;
    std::array<Index, kMost> order;
    const std::span<Index> all(order.data(), rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) all[i] = static_cast<Index>(i);
    const bool narrow = tolerance_ > 0 && rays.size() >= kFewest;
    if (narrow) aim();
    for (const Index i : all) {
        end_[i] = End::elsewhere;
        if (narrow) place(i);
    }
    Index* from = all.data();
    Index* const last = from + all.size();
    for (const End end : {End::space, End::ground, End::elsewhere}) {
        Index* const to = std::partition(from, last, [&](Index i) { return end_[i] == end; });
        trace(std::span(from, to), end, 0);
        from = to;
    }
}

/// The axes: light varies most with elevation.
void RayBundle::aim() noexcept {
    Vec3 sum{};
    for (const Ray& ray : rays_) sum += ray.direction;
    axis_ = normalized(sum);
    const Vec3 up = normalized(origin_);
    Vec3 across = cross(axis_, up);
    if (norm(across) < 1e-3) across = cross(axis_, std::abs(axis_.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0});
    across_ = normalized(across);
    upright_ = cross(across_, axis_);
}

void RayBundle::place(Index i) noexcept {
    const auto& [direction, range_m] = rays_[i];
    const double along = dot(direction, axis_);
    if (!(along > 0.5)) return;
    place_[i] = {dot(direction, across_) / along, dot(direction, upright_) / along, 0};
    if (range_m == kEndless) {
        end_[i] = End::space;
        return;
    }
    const Vec3 to = origin_ + range_m * direction;
    const double r = norm(to);
    const double height = r - light_.air().ground_radius_m();
    const bool falls = dot(to, direction) < 0;
    place_[i][2] = std::exp(-height / light_.air().description().aerosol_height_m);
    if (r >= light_.air().top_radius_m() && !falls)
        end_[i] = End::space;
    else if (falls && height > -kMostBelowGround_m && height < kNearGround_m)
        end_[i] = End::ground;
}

void RayBundle::trace(std::span<Index> set, End end, int divisions) noexcept {
    if (set.size() >= kFewest && end != End::elsewhere) {
        const Box box = bounds(set);
        if (interpolate(set, end, box)) return;
        if (divisions < kMostDivisions) {
            const double middle = 0.5 * (box.low[1] + box.high[1]);
            Index* const upper =
                std::partition(set.data(), set.data() + set.size(), [&](Index i) { return place_[i][1] < middle; });
            trace(std::span(set.data(), upper), end, divisions + 1);
            trace(std::span(upper, set.data() + set.size()), end, divisions + 1);
            return;
        }
    }
    for (const Index i : set) out_[i] = integrate(rays_[i].direction, rays_[i].range_m);
}

/// First linearly, then with a parabola upright.
bool RayBundle::interpolate(std::span<const Index> set, End end, const Box& box) noexcept {
    const auto value_at = [&](double u, double v, double w) {
        const Place share{u, v, w};
        Place p;
        for (std::size_t k = 0; k < 3; ++k) p[k] = box.low[k] + share[k] * (box.high[k] - box.low[k]);
        return at(p, end);
    };
    Grid grid;
    grid.n_density = end == End::ground && box.high[2] - box.low[2] > kLevel ? 2 : 1;
    const auto fill = [&](std::size_t row, double v) {
        for (std::size_t i = 0; i < grid.n_density; ++i)
            for (std::size_t k = 0; k < 2; ++k) {
                const auto value =
                    value_at(static_cast<double>(k), v, grid.n_density == 2 ? static_cast<double>(i) : 0.5);
                if (!value) return false;
                grid.value[i][row][k] = *value;
            }
        return true;
    };
    const auto agrees = [&](double v) {
        const auto exact = value_at(0.5, v, 0.5);
        if (!exact) return false;
        const AirLight found = grid.at({0.5, v, 0.5});
        return agree(found.in_scattering, exact->in_scattering, tolerance_,
                     kFaintest * brightest(exact->in_scattering)) &&
               agree(found.transmittance, exact->transmittance, tolerance_, kFaintest);
    };
    if (!fill(0, 0) || !fill(1, 1)) return false;
    if (!agrees(0.5)) {
        grid.n_upright = 3;
        for (auto& values : grid.value) values[2] = values[1];
        if (!fill(1, 0.5) || !agrees(0.25) || !agrees(0.5)) return false;
    }
    for (const Index i : set) {
        Place share{};
        for (std::size_t k = 0; k < 3; ++k)
            if (box.high[k] > box.low[k]) share[k] = (place_[i][k] - box.low[k]) / (box.high[k] - box.low[k]);
        out_[i] = grid.at(share);
    }
    return true;
}

RayBundle::Box RayBundle::bounds(std::span<const Index> set) const noexcept {
    Box box{place_[set.front()], place_[set.front()]};
    for (const Index i : set)
        for (std::size_t k = 0; k < 3; ++k) {
            box.low[k] = std::min(box.low[k], place_[i][k]);
            box.high[k] = std::max(box.high[k], place_[i][k]);
        }
    return box;
}

/// None where a ray does not come down to that height.
std::optional<AirLight> RayBundle::at(const Place& p, End end) noexcept {
    const Vec3 direction = normalized(axis_ + p[0] * across_ + p[1] * upright_);
    if (end == End::space) return integrate(direction, kEndless);
    const double along = dot(origin_, direction),
                 height = -light_.air().description().aerosol_height_m * std::log(p[2]),
                 r = light_.air().ground_radius_m() + height;
    const double discriminant = along * along - (dot(origin_, origin_) - r * r);
    if (!(along < 0) || !(discriminant > 0)) return std::nullopt;
    const double range = -along - std::sqrt(discriminant);
    if (!(range > 0)) return std::nullopt;
    return integrate(direction, range);
}

AirLight RayBundle::integrate(const Vec3& direction, double range_m) noexcept {
    ++integrals_;
    return air_along(light_, origin_, direction, range_m, to_sun_);
}

}  // namespace narpa
