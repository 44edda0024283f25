#include "renderer/trace/shared_bounces.h"

#include <algorithm>
#include <cmath>

#include "base/each_isa.h"

namespace narpa {
namespace {

/// As for lights (lights.cpp): rounding in single precision, where meshes are, and in double.
constexpr double kTouching = 4e-6, kTouchingFarOff = 1e-15;
/// Bounces that are joined to all points, on average; of more the brightest are likeliest.
constexpr double kBounces = 8;
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

void Starts::add(const Placement& at, const Hit& hit, const PathPoint& point, const Path& path,
                 float chance) noexcept {
    const std::size_t i = n_ % kPacket;
    Block& b = block_[n_ / kPacket];
    if (i == 0) b.special = 0, b.hits.met = 0, b.hits.outside = 0;
    b.hits.put(i, hit);
    const Rigid3& T = at.T_world_body[static_cast<std::size_t>(hit.body)];
    b.origin.put(i, T * hit.departure_body);
    b.plane.put(i, point.plane());
    b.diffuse.put(i, point.surface().diffuse * kInvPi);
    b.chance[i] = static_cast<double>(chance);
    if (!point.plain() || path.guide.share() > 0) b.special |= 1u << i;
    points_[n_] = point;
    paths_[n_] = path;
    ++n_;
}

NARPA_EACH_ISA void Starts::join(const Block& b, const Bounce& bounce, Join& __restrict j) noexcept {
    const Vec3 position = bounce.position, normal = bounce.point.plane();
    Lanes<int> faces;
    for (std::size_t i = 0; i < kPacket; ++i) {
        const Vec3 way = position - b.origin[i];
        const double distance2 = dot(way, way), distance = std::sqrt(distance2);
        const Vec3 l = way * (1 / distance);
        const double leaves = dot(b.plane[i], l), arrives = -dot(normal, l);
        const double touching = bounce.touching_m + kTouchingFarOff * distance;
        j.direction.put(i, l);
        j.range_m[i] = distance - touching / std::max(arrives, kGrazing);
        j.geometry[i] = arrives / distance2;
        j.density[i] = leaves * std::numbers::inv_pi * j.geometry[i] * b.chance[i];
        faces[i] = -static_cast<int>((leaves > 0) & (arrives > 0) & (distance2 > 0));
    }
    j.lit = bits_of(faces);
}

std::uint64_t Starts::gather(const Tracer& tracer, const Placement& at, const Bounce& bounce, float scale,
                             std::span<Rgb> radiance) const noexcept {
    std::array<Join, kStream / kPacket> joins;
    std::array<Lanes<Rgb>, kStream / kPacket> reflected;
    double density = 0;
    std::uint64_t rays = 0;
    for (std::size_t k = 0; k < blocks(); ++k) {
        const Block& b = block_[k];
        Join& j = joins[k];
        join(b, bounce, j);
        j.lit &= lanes_below(std::min(kPacket, n_ - k * kPacket));
        for_each_lane(j.lit & b.special, [&](std::size_t i) {
            const PathPoint& p = points_[k * kPacket + i];
            const Path& path = paths_[k * kPacket + i];
            const PathPoint::Response r = p.respond(j.direction[i]);
            double pdf = r.pdf;
            if (const double share = path.guide.share(); share > 0)
                pdf = (1 - share) * pdf + share * path.guide.pdf(tracer, at, path.start, j.direction[i]);
            j.density[i] = pdf * j.geometry[i] * b.chance[i];
            reflected[k][i] = r.f_cos;
        });
        std::uint32_t asked = j.lit;
        if (bounce.found_from / kPacket == k) asked &= ~(1u << bounce.found_from % kPacket);
        Lanes<int> beyond;
        for (std::size_t i = 0; i < kPacket; ++i) beyond[i] = -static_cast<int>(j.range_m[i] > 0);
        asked &= bits_of(beyond);
        j.lit &= ~tracer.occluded(at, b.hits, j.direction, j.range_m, asked);
        rays += static_cast<std::uint64_t>(std::popcount(asked));
        for_each_lane(j.lit, [&](std::size_t i) { density += j.density[i]; });
    }
    if (!(density > 0)) return rays;
    const bool even = bounce.point.plain();
    const Rgb light = even ? bounce.towards(bounce.point.plane()) : Rgb{};
    const double per_density = static_cast<double>(scale) / density;
    for (std::size_t k = 0; k < blocks(); ++k) {
        const Block& b = block_[k];
        const Join& j = joins[k];
        for_each_lane(j.lit, [&](std::size_t i) {
            const Vec3 l = j.direction[i];
            Rgb f = is_set(b.special, i) ? reflected[k][i] : b.diffuse[i] * static_cast<float>(dot(b.plane[i], l));
            f *= static_cast<float>(j.geometry[i] * per_density);
            radiance[paths_[k * kPacket + i].ray] += f * (even ? light : bounce.towards(-l));
        });
    }
    return rays;
}

std::uint64_t Starts::gather(const Tracer& tracer, const Placement& at, std::span<Bounce> bounces, double choice,
                             std::span<Rgb> radiance) const noexcept {
    Room<float> bright;
    double sum = 0;
    for (std::size_t i = 0; i < bounces.size(); ++i) {
        const Bounce& b = bounces[i];
        bright[i] = brightness(b.towards(b.point.view()));
        sum += static_cast<double>(bright[i]);
    }
    if (sum == 0) return 0;
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
    return rays;
}

}  // namespace narpa
