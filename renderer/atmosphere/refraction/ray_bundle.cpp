#include "renderer/atmosphere/refraction/ray_bundle.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "base/each_isa.h"
#include "renderer/atmosphere/fast_exp.h"

namespace narpa {
namespace {

constexpr double kEndless = std::numeric_limits<double>::infinity();
/// Bundles, and cells, with fewer rays are integrated ray by ray, because their nodes would cost more.
constexpr std::size_t kFewest = 12;
constexpr double kFewestInCell = 26;
constexpr int kMaxHalvings = 24;
/// Undivided cells: their number per unit tangent, per octave of range, and per octave of the tangent above the
/// horizon; the tangent above which the cells are spaced logarithmically, because the air column falls in inverse
/// proportion there; the height of layers.
constexpr double kPerTangent = 8, kPerRangeOctave = 2, kPerTangentOctave = 4, kLowTangent = 0.04, kLayer_m = 256;
/// Ray ends between these heights above and below the ground count as near the ground.
constexpr double kNearGround_m = 10'000, kMaxBelowGround_m = 500;
/// Ray ends this close to a layer count as on it.
constexpr double kOnLayer_m = 0.5;
/// Floors of the relative comparison, as a fraction of the brightest band and of a transmittance of 1: fainter
/// values may differ more.
constexpr float kFaintest = 1e-3f, kFaintestThrough = 1e-2f;

/// Piecewise linear approximation of log2, exact at powers of two; its inverse.
constexpr std::int64_t kOne = 1023LL << 52;
double octaves(double x) noexcept {
    return static_cast<double>(std::bit_cast<std::int64_t>(x) - kOne) * 0x1p-52;
}
double from_octaves(double n) noexcept {
    return std::bit_cast<double>(static_cast<std::int64_t>(n * 0x1p52) + kOne);
}

/// Coordinate v of a tangent above the horizon (negative below), and the inverse.
double from_tangent(double x) noexcept {
    return std::copysign(kPerTangentOctave * octaves(1 + std::abs(x) / kLowTangent), x);
}
double to_tangent(double v) noexcept {
    return std::copysign(kLowTangent * (from_octaves(std::abs(v) / kPerTangentOctave) - 1), v);
}

std::int32_t floor_of(double x) noexcept {
    const auto i = static_cast<std::int32_t>(x);
    return i - (x < i ? 1 : 0);
}

/// Number of divided cells per undivided cell along one axis.
double steps(std::int8_t halvings) noexcept {
    return static_cast<double>(1 << halvings);
}

bool agree(const Rgb& a, const Rgb& b, float tolerance, float floor) noexcept {
    for (int band = 0; band < 3; ++band)
        if (std::abs(a[band] - b[band]) > tolerance * (std::abs(b[band]) + floor)) return false;
    return true;
}

float brightest(const Rgb& light) noexcept {
    return std::max({light.x, light.y, light.z});
}

/// Weights of three equally spaced nodes in quadratic interpolation.
std::array<float, 3> parabola(float x) noexcept {
    return {(1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1)};
}

/// Position in a cell, 0 to 1 along each axis.
struct InCell {
    float u, v, layer;
};
using PaddedLight = std::array<float, 8>;

/// Interpolates the nodes of one cell.
NARPA_EACH_ISA void blend(const PaddedLight* __restrict nodes, std::size_t layers, const InCell& at,
                          PaddedLight& __restrict out) noexcept {
    const std::array<float, 3> wu = parabola(at.u), wv = parabola(at.v);
    const std::array<float, 2> wl{layers == 2 ? 1 - at.layer : 1, at.layer};
    Vector8 sum{}, node, through;
    for (std::size_t layer = 0; layer < layers; ++layer)
        for (std::size_t j = 0; j < 3; ++j)
            for (std::size_t i = 0; i < 3; ++i) {
                load(nodes[layer * AirCell::kLayer + 3 * j + i].data(), node);
                sum += wl[layer] * wv[j] * wu[i] * node;
            }
    sum = sum > 0.0f ? sum : Vector8{};
    exp_of_negative(-sum, through);
    store(sum, out.data());
    for (std::size_t k = 0; k < 3; ++k) out[k] = through[k];
}

/// The nodes of a cell in the form that blend() needs: optical depth in place of transmittance, which falls by
/// orders of magnitude towards the horizon.
class Blender {
public:
    Blender(const AirCell::Nodes& nodes, std::size_t layers) : layers_(layers) {
        for (std::size_t i = 0; i < layers * AirCell::kLayer; ++i) {
            const auto& [t, s] = nodes[i];
            nodes_[i] = {depth(t.x), depth(t.y), depth(t.z), s.x, s.y, s.z, 0, 0};
        }
    }
    [[nodiscard]] AirLight operator()(const InCell& at) const noexcept {
        PaddedLight x;
        blend(nodes_.data(), layers_, at, x);
        return {{x[0], x[1], x[2]}, {x[3], x[4], x[5]}};
    }

private:
    [[nodiscard]] static float depth(float transmittance) noexcept {
        return -std::log(std::max(transmittance, std::numeric_limits<float>::min()));
    }

    std::size_t layers_;
    std::array<PaddedLight, AirCell::kMaxNodes> nodes_;
};

std::uint64_t mixed(std::uint64_t hash, const Vec3& v) noexcept {
    for (const double x : {v.x, v.y, v.z}) hash = narpa::mixed(hash, std::bit_cast<std::uint64_t>(x));
    return hash;
}

}  // namespace

AirLight air_along(const ScatteredLight& light, const Vec3& origin, const Vec3& direction, double range_m,
                   const Vec3* to_sun) noexcept {
    const Air& air = light.air();
    if (to_sun == nullptr) return {transmittance_of(air, light.columns(origin, direction, range_m)), {}};
    const ScatteredLight::Segment s = light.along(origin, direction, range_m, *to_sun);
    return {transmittance_of(air, s.columns), bands_of(air, s.in_scattering)};
}

RayBundle::RayBundle(const ScatteredLight& light, const Vec3& origin, const Vec3* to_sun, AirCache& cells,
                     float tolerance) noexcept
    : light_(light), origin_(origin), to_sun_(to_sun), cells_(cells), tolerance_(tolerance) {}

void RayBundle::trace(std::span<const Ray> rays, std::span<AirLight> out) noexcept {
    rays_ = rays, out_ = out;
    const int halvings = rays.size() < kFewest || tolerance_ <= 0 ? -1 : max_halvings();
    if (halvings < 0) {
        for (std::size_t i = 0; i < rays.size(); ++i) out[i] = integrate(rays[i].direction, rays[i].range_m);
        return;
    }
    aim();
    std::array<Index, kMax> order;
    std::size_t n = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        place(i);
        if (place_[i].end == End::elsewhere)
            out[i] = integrate(rays[i].direction, rays[i].range_m);
        else
            order[n++] = static_cast<Index>(i);
    }
    trace(std::span(order.data(), n), {}, halvings);
}

/// Number of halvings after which a cell holds about kFewestInCell rays, at this bundle's density of rays; -1 if an
/// undivided cell holds fewer.
int RayBundle::max_halvings() const noexcept {
    Vec3 low = rays_.front().direction, high = low;
    for (const Ray& ray : rays_) {
        const Vec3& d = ray.direction;
        low = {std::min(low.x, d.x), std::min(low.y, d.y), std::min(low.z, d.z)};
        high = {std::max(high.x, d.x), std::max(high.y, d.y), std::max(high.z, d.z)};
    }
    const double extent = std::max({high.x - low.x, high.y - low.y, high.z - low.z, 1e-9}) * kPerTangent;
    const double rays = static_cast<double>(rays_.size()) / (extent * extent);
    return static_cast<int>(std::clamp(std::floor(std::log2(rays / kFewestInCell)), -1.0, double{kMaxHalvings}));
}

/// Sets the axes, and the part of the keys that all cells share.
void RayBundle::aim() noexcept {
    up_ = normalized(origin_);
    Vec3 front = to_sun_ != nullptr ? *to_sun_ - dot(*to_sun_, up_) * up_ : Vec3{};
    if (norm(front) < 1e-6) front = cross(up_, std::abs(up_.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0});
    front_ = normalized(front);
    left_ = cross(up_, front_);
    const double sine = std::min(1.0, light_.air().ground_radius_m() / norm(origin_));
    horizon_ = std::max(-1.0, -std::sqrt(1 - sine * sine) / sine);
    seed_ = mixed(0, origin_);
    if (to_sun_ != nullptr) seed_ = mixed(seed_, *to_sun_);
}

void RayBundle::place(std::size_t i) noexcept {
    const auto& [direction, range_m] = rays_[i];
    Place& p = place_[i];
    p.layer = 0;
    p.end = End::space;
    if (range_m != kEndless) {
        const Vec3 to = origin_ + range_m * direction;
        const double r = norm(to), height_m = r - light_.air().ground_radius_m();
        const bool falls = dot(to, direction) < 0;
        if (r < light_.air().top_radius_m() || falls) {
            p.layer = height_m / kLayer_m;
            p.end =
                falls && height_m > -kMaxBelowGround_m && height_m < kNearGround_m ? End::ground : End::elsewhere;
        }
    }
    const double x = dot(direction, front_), y = dot(direction, left_), z = dot(direction, up_);
    const double level2 = x * x + y * y;
    if (z * z > level2) {
        p.chart = z > 0 ? Chart::zenith : Chart::nadir;
        p.u = kPerTangent * x / std::abs(z), p.v = kPerTangent * y / std::abs(z);
        return;
    }
    const bool along = std::abs(x) >= std::abs(y);
    p.chart = along ? (x > 0 ? Chart::front : Chart::back) : (y > 0 ? Chart::left : Chart::right);
    p.u = kPerTangent * (along ? y / x : -x / y);
    p.v = p.end == End::space ? from_tangent(z / std::sqrt(level2) - horizon_) : kPerRangeOctave * octaves(range_m);
}

RayBundle::Cell RayBundle::cell_of(const Place& p, const Subdivision& halved) noexcept {
    const double layer = p.layer * steps(halved.layer);
    const std::int32_t nearest = floor_of(layer + 0.5);
    const bool one_layer = std::abs(layer - nearest) * kLayer_m <= kOnLayer_m * steps(halved.layer);
    return {floor_of(p.u * steps(halved.u)),
            floor_of(p.v * steps(halved.v)),
            one_layer ? nearest : floor_of(layer),
            p.chart,
            p.end,
            one_layer,
            halved};
}

std::uint64_t RayBundle::key(const Cell& c) const noexcept {
    const auto pack = [](auto high, auto low) {
        return static_cast<std::uint64_t>(static_cast<std::uint32_t>(high)) << 32 | static_cast<std::uint32_t>(low);
    };
    const auto kind = static_cast<std::uint32_t>(c.chart) | static_cast<std::uint32_t>(c.end) << 4 |
                      static_cast<std::uint32_t>(c.one_layer) << 8 | static_cast<std::uint32_t>(c.halved.u) << 12 |
                      static_cast<std::uint32_t>(c.halved.v) << 18 |
                      static_cast<std::uint32_t>(c.halved.layer) << 24;
    return narpa::mixed(narpa::mixed(seed_, pack(c.u, c.v)), pack(c.layer, kind));
}

void RayBundle::trace(std::span<Index> set, const Subdivision& halved, int more) noexcept {
    for (const Index i : set) cell_[i] = cell_of(place_[i], halved);
    while (!set.empty()) {
        const Cell cell = cell_[set.front()];
        Index* const end =
            std::partition(set.data(), set.data() + set.size(), [&](Index i) { return cell_[i] == cell; });
        const std::span inside(set.data(), end);
        set = set.subspan(inside.size());
        AirCell found;
        const std::uint64_t name = key(cell);
        if (!cells_.find(name, found)) {
            make(cell, found);
            cells_.store(name, found);
        }
        const auto halves = [&](std::int8_t n, std::uint32_t side) {
            return static_cast<std::int8_t>(n + ((found.differs & side) != 0 ? 1 : 0));
        };
        const int needs = std::popcount(found.differs);
        if (needs == 0)
            interpolate(inside, cell, found);
        else if (needs <= more)
            trace(inside,
                  {halves(halved.u, AirCell::kAlongU), halves(halved.v, AirCell::kAlongV),
                   halves(halved.layer, AirCell::kAlongHeight)},
                  more - needs);
        else
            for (const Index i : inside) out_[i] = integrate(rays_[i].direction, rays_[i].range_m);
    }
}

void RayBundle::interpolate(std::span<const Index> set, const Cell& cell, const AirCell& found) noexcept {
    const Blender blended(found.nodes, found.layers);
    for (const Index i : set) {
        const Place& p = place_[i];
        out_[i] = blended({static_cast<float>(p.u * steps(cell.halved.u) - cell.u),
                           static_cast<float>(p.v * steps(cell.halved.v) - cell.v),
                           static_cast<float>(p.layer * steps(cell.halved.layer) - cell.layer)});
    }
}

/// Integrates the nodes and compares interpolated with integrated values between them along each axis; `differs`
/// tells where they disagree. Most cells that must be divided fail at the first column of nodes.
void RayBundle::make(const Cell& cell, AirCell& out) noexcept {
    out.layers = cell.one_layer ? 1 : 2;
    out.differs = AirCell::kAlongU | AirCell::kAlongV;
    // Columns that are not filled yet have weight 0 in the comparison, but 0 * NaN is NaN.
    for (std::size_t i = 0; i < out.layers * AirCell::kLayer; ++i) out.nodes[i] = {};
    const auto fill = [&](std::size_t column) {
        for (std::size_t layer = 0; layer < out.layers; ++layer)
            for (std::size_t row = 0; row < 3; ++row) {
                const auto value = at(cell, 0.5 * static_cast<double>(column), 0.5 * static_cast<double>(row),
                                      static_cast<double>(layer));
                if (!value) return false;
                out.nodes[layer * AirCell::kLayer + 3 * row + column] = *value;
            }
        return true;
    };
    const auto differs = [&](double u, double v, double layer) {
        const auto exact = at(cell, u, v, layer);
        if (!exact) return true;
        const AirLight near = Blender(
            out.nodes, out.layers)({static_cast<float>(u), static_cast<float>(v), static_cast<float>(layer)});
        return !agree(near.transmittance, exact->transmittance, tolerance_, kFaintestThrough) ||
               !agree(near.in_scattering, exact->in_scattering, tolerance_,
                      kFaintest * brightest(exact->in_scattering));
    };
    for (const std::size_t column : {std::size_t{0}, std::size_t{2}}) {
        if (!fill(column)) return;
        if (differs(0.5 * static_cast<double>(column), column == 0 ? 0.25 : 0.75, 0)) {
            out.differs = AirCell::kAlongV;
            return;
        }
    }
    if (!fill(1)) return;
    out.differs = (differs(0.25, 1, 0) || differs(0.75, 0, 0) ? AirCell::kAlongU : 0) |
                  (out.layers == 2 && differs(0.5, 0.5, 0.5) ? AirCell::kAlongHeight : 0);
}

/// Air along the ray through a position in a cell, 0 to 1 along each axis; nullopt where there is no such ray.
std::optional<AirLight> RayBundle::at(const Cell& cell, double u, double v, double layer) noexcept {
    u = (cell.u + u) / steps(cell.halved.u), v = (cell.v + v) / steps(cell.halved.v);
    const double height_m = (cell.layer + layer) / steps(cell.halved.layer) * kLayer_m;
    const Vec3 level = level_direction(cell.chart, u / kPerTangent);
    if (cell.chart == Chart::zenith || cell.chart == Chart::nadir) {
        const Vec3 up = cell.chart == Chart::zenith ? up_ : -up_;
        const Vec3 direction = normalized(level + v / kPerTangent * left_ + up);
        if (cell.end == End::space) return integrate(direction, kEndless);
        const double range = range_down_to(direction, height_m);
        if (!(range > 0)) return std::nullopt;
        return integrate(direction, range);
    }
    if (cell.end == End::space) return integrate(normalized(level + (to_tangent(v) + horizon_) * up_), kEndless);
    const double range = from_octaves(v / kPerRangeOctave), r = norm(origin_),
                 end = light_.air().ground_radius_m() + height_m;
    const double sine = ((end - r) * (end + r) - range * range) / (2 * r * range);
    if (!(std::abs(sine) < 1)) return std::nullopt;
    return integrate(std::sqrt(1 - sine * sine) * level + sine * up_, range);
}

Vec3 RayBundle::level_direction(Chart chart, double u) const noexcept {
    switch (chart) {
        case Chart::front: return normalized(front_ + u * left_);
        case Chart::left: return normalized(left_ - u * front_);
        case Chart::back: return -normalized(front_ + u * left_);
        case Chart::right: return -normalized(left_ - u * front_);
        default: return u * front_;
    }
}

/// Negative or NaN where the ray does not come down to that height.
double RayBundle::range_down_to(const Vec3& direction, double height_m) const noexcept {
    const double r = light_.air().ground_radius_m() + height_m, along = dot(origin_, direction);
    return -along - std::sqrt(along * along - (dot(origin_, origin_) - r * r));
}

AirLight RayBundle::integrate(const Vec3& direction, double range_m) noexcept {
    ++integrals_;
    return air_along(light_, origin_, direction, range_m, to_sun_);
}

}  // namespace narpa
