#include "renderer/integrator/path_reuse.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/each_isa.h"

namespace narpa {
namespace {

/// As for lights (lights.cpp): rounding in single precision, where meshes are, and in double.
constexpr double kTouching = 4e-6, kTouchingFarOff = 1e-15;
/// Bounces that are joined, on average; of more the brightest are likeliest.
constexpr double kBounces = 16;
/// Starts that share, in blocks of sixteen. Light from far off, on which all of a group agree, wants large ones;
/// light from close by, and the rays that ask what they see of it, small ones.
constexpr std::size_t kBlocksOfAGroup = 2;
/// A ray along a surface cannot tell where it ends within so many times that.
constexpr double kGrazing = 1e-3;
constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);

float brightness(const Rgb& c) {
    return std::max({c.x, c.y, c.z});
}

}  // namespace

bool Bounce::possible(const PathPoint& p) noexcept {
    // A lobe alone is looked for along its mirror direction, which is another for each receiver.
    const Material::Kind kind = p.surface().material->kind;
    return (kind == Material::Kind::lambert || kind == Material::Kind::phong) && !p.bent() &&
           brightness(p.surface().diffuse) > 0;
}

Rgb Bounce::towards(const Vec3& direction) const noexcept {
    Rgb sum{};
    for (const Incident& i : incident) {
        if (i.light == Rgb{}) continue;
        const double cosine = dot(point.plane(), i.from);
        sum += i.light * bsdf(point.surface(), point.plane(), i.from, direction) * static_cast<float>(cosine);
    }
    return sum;
}

Starts::Block& Starts::next_block() noexcept {
    Block& b = block_[n_ / kLanes];
    if (n_ % kLanes == 0) b.special = b.guided = b.hits.outside = 0;
    return b;
}

int Starts::add(const BodyPoses& at, const FirstSurface& first, std::size_t ray, float chance) noexcept {
    Block& b = next_block();
    const std::size_t i = n_ % kLanes, from = first.lane;
    const HitBatch& hits = *first.hits;
    const Vec3 departure = hits.departure_body[from];
    b.hits.body[i] = hits.body[from];
    b.hits.face[i] = hits.face[from];
    b.hits.departure_body.put(i, departure);
    b.hits.outside |= static_cast<std::uint32_t>(is_set(hits.outside, from)) << i;
    b.origin.put(i, at.T_world_body_at(static_cast<std::size_t>(hits.body[from]), hits.time[from]) * departure);
    b.plane.put(i, hits.geometric_normal[from]);
    b.diffuse.put(i, kInvPi * first.surfaces->diffuse[from]);
    b.chance[i] = chance;
    if (first.surfaces->specular[from] != Rgb{}) b.special |= 1u << i;
    ray_[n_] = static_cast<std::uint32_t>(ray);
    lit_[n_] = &first;
    return static_cast<int>(n_++);
}

int Starts::add(const BodyPoses& at, const Hit& hit, const PathPoint& point, const Path& path,
                float chance) noexcept {
    Block& b = next_block();
    const std::size_t i = n_ % kLanes;
    b.hits.body[i] = hit.body;
    b.hits.face[i] = hit.face;
    b.hits.departure_body.put(i, hit.departure_body);
    b.hits.outside |= static_cast<std::uint32_t>(hit.outside) << i;
    b.origin.put(i, at.T_world_body_at(static_cast<std::size_t>(hit.body), hit.time) * hit.departure_body);
    b.plane.put(i, point.plane());
    b.diffuse.put(i, kInvPi * point.surface().diffuse);
    b.chance[i] = chance;
    ray_[n_] = path.ray;
    lit_[n_] = nullptr;
    const bool guided = path.guide.share() > 0;
    if (guided) {
        b.guided |= 1u << i;
        paths_[n_] = path;
    }
    if (!point.plain() || guided) {
        b.special |= 1u << i;
        points_[n_] = point;
    }
    return static_cast<int>(n_++);
}

/// Of lit ones with a lobe.
void Starts::make_points(const Tracer& tracer, const BodyPoses& at, double pixel_angle_rad) noexcept {
    for (std::size_t k = 0; k < n_; ++k) {
        if (lit_[k] == nullptr || !is_set(block_[k / kLanes].special, k % kLanes)) continue;
        const FirstSurface& f = *lit_[k];
        const Hit hit = (*f.hits)[f.lane];
        points_[k] = PathPoint(tracer, at, hit, f.rays->direction[f.lane], pixel_angle_rad * hit.range_m, true);
    }
}

NARPA_EACH_ISA void Starts::join(const Block& b, const Bounce& bounce, Join& __restrict j) noexcept {
    const Vec3 position = bounce.position, normal = bounce.point.plane();
    Lanes<int> faces;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 way = position - b.origin[i];
        const double distance2 = dot(way, way), distance = std::sqrt(distance2);
        const Vec3 l = way * (1 / distance);
        const double leaves = dot(b.plane[i], l), arrives = -dot(normal, l);
        const double touching = bounce.touching_m + kTouchingFarOff * distance;
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

/// Those of a block that see the bounce. Returns the number of rays that it took.
std::uint64_t Starts::join_seen(const Tracer& tracer, const BodyPoses& at, std::size_t block, const Bounce& bounce,
                                Join& j) const noexcept {
    const Block& b = block_[block];
    const std::size_t first = block * kLanes;
    join(b, bounce, j);
    j.lit &= lanes_below(std::min(kLanes, n_ - first));
    for_each_lane(j.lit & b.special, [&](std::size_t i) {
        const PathPoint::Response r = points_[first + i].respond(j.direction[i]);
        j.density[i] = r.pdf;
        j.reflected.put(i, r.f_cos);
    });
    for_each_lane(j.lit & b.guided, [&](std::size_t i) {
        const Path& path = paths_[first + i];
        const double share = path.guide.share();
        j.density[i] = (1 - share) * j.density[i] + share * path.guide.pdf(tracer, at, path.start, j.direction[i]);
    });
    std::uint32_t asked = j.lit;
    if (bounce.found_from / kLanes == block) asked &= ~(1u << bounce.found_from % kLanes);
    for_each_lane(asked, [&](std::size_t i) {
        if (!(j.range_m[i] > 0)) asked &= ~(1u << i);  // they touch
    });
    j.lit &= ~tracer.occluded(at, b.hits, j.direction, j.range_m, asked);
    return static_cast<std::uint64_t>(std::popcount(asked));
}

std::uint64_t Starts::gather(const Tracer& tracer, const BodyPoses& at, const Bounce& bounce, float scale,
                             std::span<Rgb> radiance) noexcept {
    const std::size_t group = bounce.found_from / kLanes / kBlocksOfAGroup * kBlocksOfAGroup;
    const std::size_t n = std::min(kBlocksOfAGroup, blocks() - group);
    std::array<Join, kBlocksOfAGroup> joins;
    double density = 0;
    std::uint64_t rays = 0;
    for (std::size_t k = 0; k < n; ++k) {
        const Block& b = block_[group + k];
        Join& j = joins[k];
        rays += join_seen(tracer, at, group + k, bounce, j);
        for_each_lane(j.lit, [&](std::size_t i) {
            density += j.density[i] * j.geometry[i] * static_cast<double>(b.chance[i]);
        });
    }
    if (!(density > 0)) return rays;
    const bool even = bounce.point.plain();
    const Rgb light = even ? bounce.towards(bounce.point.plane()) : Rgb{};
    const double per_density = static_cast<double>(scale) / density;
    for (std::size_t k = 0; k < n; ++k) {
        const Join& j = joins[k];
        for_each_lane(j.lit, [&](std::size_t i) {
            const Rgb f = j.reflected[i] * static_cast<float>(j.geometry[i] * per_density);
            const std::size_t number = (group + k) * kLanes + i;
            const Rgb sent = f * (even ? light : bounce.towards(-j.direction[i]));
            const float mean = mean_band(sent);
            radiance[ray_[number]] += sent;
            sum_[number] += mean;
            squares_[number] += mean * mean;
        });
    }
    return rays;
}

std::uint64_t Starts::gather(const Tracer& tracer, const BodyPoses& at, std::span<Bounce> bounces, double choice,
                             double pixel_angle_rad, std::span<Rgb> radiance, std::span<float> variance) noexcept {
    Room<float> bright;
    double sum = 0;
    for (std::size_t i = 0; i < bounces.size(); ++i) {
        const Bounce& b = bounces[i];
        bright[i] = brightness(b.towards(b.point.view()));
        sum += static_cast<double>(bright[i]);
    }
    if (sum == 0) return 0;
    make_points(tracer, at, pixel_angle_rad);
    std::fill_n(sum_.begin(), n_, 0.0f);
    std::fill_n(squares_.begin(), n_, 0.0f);
    const double wanted = std::min(kBounces, static_cast<double>(bounces.size()));
    double passed = choice;
    std::uint64_t rays = 0;
    for (std::size_t i = 0; i < bounces.size(); ++i) {
        const double chance = std::min(1.0, wanted * static_cast<double>(bright[i]) / sum);
        if (chance == 0) continue;
        passed += chance;
        if (passed < 1 && chance < 1) continue;
        if (passed >= 1) passed -= 1;
        rays += gather(tracer, at, bounces[i], static_cast<float>(1 / chance), radiance);
    }
    // Each path that set out brought its part, most of them none: their scatter is that of the sum.
    double set_out = 0;
    for (std::size_t k = 0; k < n_; ++k) set_out += static_cast<double>(block_[k / kLanes].chance[k % kLanes]);
    const auto n = static_cast<float>(std::max(set_out, 2.0));
    for (std::size_t k = 0; k < n_; ++k)
        variance[ray_[k]] = std::max(0.0f, squares_[k] - sum_[k] * sum_[k] / n) * n / (n - 1);
    return rays;
}

}  // namespace narpa
