#include "renderer/integrator/path_reuse.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/each_isa.h"

namespace narpa {
namespace {

/// Rounding error relative to the distance.
constexpr double kTouchingFarOff = 1e-15;
/// Mean number of second vertices that are connected; if there are more, brighter ones are more likely.
constexpr double kJoined = 16;
/// Number of first vertices that share paths, in blocks of sixteen. Distant light, alike for all, favours more;
/// near light and the cost of shadow rays favour fewer.
constexpr std::size_t kBlocksOfAGroup = 2;
/// Smallest cosine by which `touching_m` is divided; it is divided because a grazing ray passes more of that
/// distance.
constexpr double kGrazing = 1e-3;
constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);

}  // namespace

SecondVertex::SecondVertex(const Tracer& tracer, const PathVertex& a_vertex, const Hit& hit,
                           std::size_t a_found_from) noexcept
    : vertex(a_vertex), position(hit.position), found_from(a_found_from) {
    touching_m = tracer.shape(static_cast<std::size_t>(hit.body)).properties().resolution_m;
}

bool SecondVertex::is_reusable(const PathVertex& p) noexcept {
    // A surface with only a lobe reflects along its mirror direction, which differs for each receiver.
    return is_lambert_or_phong(*p.surface().material) && !p.bent() && max_component(p.surface().diffuse) > 0;
}

bool SecondVertex::leave(Path& p, const BsdfSample& s, float inverse_survival) noexcept {
    if (!(s.pdf > 0)) return false;
    const float before = max_component(p.throughput), per_pdf = inverse_survival / static_cast<float>(s.pdf);
    p.throughput = {per_pdf, per_pdf, per_pdf};
    p.radiance_scale *= per_pdf / before;
    incident[path].from = s.l;
    p.to = &incident[path].light;
    return true;
}

Rgb SecondVertex::radiance(const Vec3& direction) const noexcept {
    Rgb sum{};
    for (const Incident& i : incident) {
        if (i.light == Rgb{}) continue;
        const double cosine = dot(vertex.plane(), i.from);
        sum += i.light * bsdf(vertex.surface(), vertex.plane(), i.from, direction) * static_cast<float>(cosine);
    }
    return sum;
}

FirstVertices::Block& FirstVertices::next_block() noexcept {
    Block& b = block_[n_ / kLanes];
    if (n_ % kLanes == 0) b.special = b.small_bodies = b.points.outside = 0;
    return b;
}

int FirstVertices::add(const BodyPoses& at, const PathStart& start, const Path& path, float survival) noexcept {
    Block& b = next_block();
    const std::size_t i = n_ % kLanes, from = start.lane;
    const HitBatch& hits = *start.hits;
    b.points.put(i, hits, from);
    b.origin.put(i, at.T_world_body_at(static_cast<std::size_t>(hits.body[from]), hits.time[from]) *
                        hits.departure_body[from]);
    b.plane.put(i, hits.geometric_normal[from]);
    b.diffuse.put(i, kInvPi * start.surfaces->diffuse[from]);
    if (start.surfaces->specular[from] != Rgb{}) b.special |= 1u << i;
    return add_to(b, path, survival, &start);
}

int FirstVertices::add(const BodyPoses& at, const Hit& hit, const PathVertex& vertex, const Path& path,
                       float survival) noexcept {
    Block& b = next_block();
    const std::size_t i = n_ % kLanes;
    b.points.put(i, hit);
    b.origin.put(i, at.T_world_body_at(static_cast<std::size_t>(hit.body), hit.time) * hit.departure_body);
    b.plane.put(i, vertex.plane());
    b.diffuse.put(i, kInvPi * vertex.surface().diffuse);
    if (!vertex.plain()) b.special |= 1u << i;
    const int number = add_to(b, path, survival, nullptr);
    if (is_set(b.special, i)) vertices_[static_cast<std::size_t>(number)] = vertex;
    return number;
}

int FirstVertices::add_to(Block& b, const Path& path, float survival, const PathStart* lit) noexcept {
    const std::size_t i = n_ % kLanes;
    b.survival[i] = survival;
    ray_[n_] = path.ray;
    lit_[n_] = lit;
    if (path.small_bodies.share() > 0) {
        b.special |= 1u << i;
        b.small_bodies |= 1u << i;
        paths_[n_] = path;
    }
    return static_cast<int>(n_++);
}

/// Makes the vertices of special lanes whose direct light is known.
void FirstVertices::make_vertices(const Tracer& tracer, const BodyPoses& at, double pixel_angle_rad) noexcept {
    for (std::size_t k = 0; k < n_; ++k) {
        if (lit_[k] == nullptr || !is_set(block_[k / kLanes].special, k % kLanes)) continue;
        const PathStart& s = *lit_[k];
        const Hit hit = (*s.hits)[s.lane];
        vertices_[k] = PathVertex(tracer, at, hit, s.rays->direction[s.lane], pixel_angle_rad * hit.range_m, true);
    }
}

NARPA_EACH_ISA void FirstVertices::join(const Block& b, const SecondVertex& second, Join& __restrict j) noexcept {
    const Vec3 position = second.position, normal = second.vertex.plane();
    Lanes<int> faces;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 to_second = position - b.origin[i];
        const double distance2 = dot(to_second, to_second), distance = std::sqrt(distance2);
        const Vec3 l = to_second * (1 / distance);
        const double leaves = dot(b.plane[i], l), arrives = -dot(normal, l);
        const double touching = second.touching_m + kTouchingFarOff * distance;
        const auto cosine = static_cast<float>(leaves);
        j.direction.put(i, l);
        j.range_m[i] = distance - touching / std::max(arrives, kGrazing);
        j.geometry[i] = arrives / distance2;
        j.density[i] = leaves * std::numbers::inv_pi;
        j.reflected.r[i] = b.diffuse.r[i] * cosine;
        j.reflected.g[i] = b.diffuse.g[i] * cosine;
        j.reflected.b[i] = b.diffuse.b[i] * cosine;
        faces[i] = -static_cast<int>((leaves > 0) & (arrives > 0) & (distance2 > 0));
    }
    j.lit = bits_of(faces);
}

/// Finds the lanes of a block from which the second vertex is visible. Returns the number of rays.
std::uint64_t FirstVertices::join_visible(const Tracer& tracer, const BodyPoses& at, std::size_t block,
                                          const SecondVertex& second, Join& j) const noexcept {
    const Block& b = block_[block];
    const std::size_t first = block * kLanes;
    join(b, second, j);
    j.lit &= lanes_below(std::min(kLanes, n_ - first));
    for_each_lane(j.lit & b.special, [&](std::size_t i) {
        const PathVertex::Response r = vertices_[first + i].respond(j.direction[i]);
        j.density[i] = r.pdf;
        j.reflected.put(i, r.f_cos);
    });
    for_each_lane(j.lit & b.small_bodies, [&](std::size_t i) {
        const Path& path = paths_[first + i];
        const double share = path.small_bodies.share();
        j.density[i] =
            (1 - share) * j.density[i] + share * path.small_bodies.pdf(tracer, at, path.start, j.direction[i]);
    });
    std::uint32_t lanes = j.lit;
    if (second.found_from / kLanes == block) lanes &= ~(1u << second.found_from % kLanes);
    for_each_lane(lanes, [&](std::size_t i) {
        if (!(j.range_m[i] > 0)) lanes &= ~(1u << i);  // they touch
    });
    j.lit &= ~tracer.occluded(at, b.points, j.direction, j.range_m, lanes);
    return static_cast<std::uint64_t>(std::popcount(lanes));
}

std::uint64_t FirstVertices::gather(const Tracer& tracer, const BodyPoses& at, const SecondVertex& second,
                                    float scale, std::span<Rgb> radiance) noexcept {
    const std::size_t group = second.found_from / kLanes / kBlocksOfAGroup * kBlocksOfAGroup;
    const std::size_t n = std::min(kBlocksOfAGroup, blocks() - group);
    std::array<Join, kBlocksOfAGroup> joins;
    double density = 0;
    std::uint64_t rays = 0;
    for (std::size_t k = 0; k < n; ++k) {
        const Block& b = block_[group + k];
        Join& j = joins[k];
        rays += join_visible(tracer, at, group + k, second, j);
        for_each_lane(j.lit, [&](std::size_t i) {
            density += j.density[i] * j.geometry[i] * static_cast<double>(b.survival[i]);
        });
    }
    if (!(density > 0)) return rays;
    const bool even = second.vertex.plain();
    const Rgb light = even ? second.radiance(second.vertex.plane()) : Rgb{};
    const double per_density = static_cast<double>(scale) / density;
    for (std::size_t k = 0; k < n; ++k) {
        const Join& j = joins[k];
        for_each_lane(j.lit, [&](std::size_t i) {
            const Rgb f = j.reflected[i] * static_cast<float>(j.geometry[i] * per_density);
            const std::size_t number = (group + k) * kLanes + i;
            const Rgb sent = f * (even ? light : second.radiance(-j.direction[i]));
            const float mean = mean_band(sent);
            radiance[ray_[number]] += sent;
            sum_[number] += mean;
            squares_[number] += mean * mean;
        });
    }
    return rays;
}

std::uint64_t FirstVertices::gather(const Tracer& tracer, const BodyPoses& at, std::span<SecondVertex> second,
                                    double choice, double pixel_angle_rad, std::span<Rgb> radiance,
                                    std::span<float> variance) noexcept {
    UninitializedArray<float, kReuseGroup> bright;
    double sum = 0;
    for (std::size_t i = 0; i < second.size(); ++i) {
        const SecondVertex& v = second[i];
        bright[i] = max_component(v.radiance(v.vertex.view()));
        sum += static_cast<double>(bright[i]);
    }
    if (sum == 0) return 0;
    make_vertices(tracer, at, pixel_angle_rad);
    std::fill_n(sum_.begin(), n_, 0.0f);
    std::fill_n(squares_.begin(), n_, 0.0f);
    const double wanted = std::min(kJoined, static_cast<double>(second.size()));
    double passed = choice;
    std::uint64_t rays = 0;
    for (std::size_t i = 0; i < second.size(); ++i) {
        const double chance = std::min(1.0, wanted * static_cast<double>(bright[i]) / sum);
        if (chance == 0) continue;
        passed += chance;
        if (passed < 1 && chance < 1) continue;
        if (passed >= 1) passed -= 1;
        rays += gather(tracer, at, second[i], static_cast<float>(1 / chance), radiance);
    }
    // The scatter of the surviving paths' contributions, most of them zero, gives the variance of the sum.
    double survivors = 0;
    for (std::size_t k = 0; k < n_; ++k) survivors += static_cast<double>(block_[k / kLanes].survival[k % kLanes]);
    const auto n = static_cast<float>(std::max(survivors, 2.0));
    for (std::size_t k = 0; k < n_; ++k)
        variance[ray_[k]] = std::max(0.0f, squares_[k] - sum_[k] * sum_[k] / n) * n / (n - 1);
    return rays;
}

}  // namespace narpa
