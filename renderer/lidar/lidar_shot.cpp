#include "renderer/lidar/lidar_shot.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/each_isa.h"
#include "renderer/geometry/poses_at.h"
#include "renderer/integrator/shading.h"
#include "renderer/lidar/plain_returns.h"
#include "renderer/material/bsdf_kind.h"
#include "renderer/material/texture/texture_lookup.h"

namespace narpa {
namespace {

/// Most mirrors of a path; a beam that meets more has no return.
constexpr int kMirrors = 8;

double mean(const Rgb& c) {
    return static_cast<double>(c.x + c.y + c.z) / 3;
}

/// A shot on its way from mirror to mirror.
struct Path {
    double range_m = 0, throughput = 1;  ///< of light there and back
    double one_way = 1;                  ///< of light back alone, as the Sun's
    Vec3 start{}, direction{};
    Vec3 velocity{};  ///< of the start
    double rate_m_s = 0;
};

float sunlight_on(const Tracer& tracer, const BodyPoses& at, const Hit& hit, const Surface& surface,
                  const Vec3& back, const LidarMedium* medium) {
    const auto& sun = tracer.scene().sun;
    if (!sun) return 0;
    const double cosine = dot(surface.normal, sun->direction);
    if (cosine <= 0 || tracer.occluded(at, hit, sun->direction, std::numeric_limits<double>::infinity())) return 0;
    const auto light =
        static_cast<float>(std::numbers::pi * cosine * mean(bsdf(surface, surface.normal, sun->direction, back)));
    if (medium == nullptr) return light;
    return light * static_cast<float>(medium->transmittance(at, {hit.position, sun->direction, hit.time},
                                                            std::numeric_limits<double>::infinity()));
}

/// Same as surface_at, for a lane. Most surfaces have at most a colour texture; for these the rest of the hit is
/// not read.
Surface surface_of(const Tracer& tracer, const BodyPoses& at, const HitBatch& hits, std::size_t i,
                   const Vec3& direction) {
    const Scene& scene = tracer.scene();
    const Material& m = scene.materials[static_cast<std::size_t>(hits.material[i])];
    if (has_more_than_colour(m)) return surface_at(tracer, at, hits[i], direction, 0);
    Surface s{.diffuse = m.diffuse,
              .specular = m.specular,
              .exponent = m.exponent,
              .material = &m,
              .normal = hits.shading_normal[i],
              .outside = is_set(hits.outside, i)};
    if (m.texture < 0 || !std::isfinite(hits.u[i]) || !std::isfinite(hits.v[i])) return s;
    const TextureLayout layout = tracer.shape(static_cast<std::size_t>(hits.body[i])).properties().texture_layout;
    s.diffuse = s.diffuse * texture_lookup(scene.textures[static_cast<std::size_t>(m.texture)], hits.u[i],
                                           hits.v[i], {}, layout);
    return s;
}

/// Prefetches the four texels of a lookup. Coordinates outside the image may prefetch other texels, which does no
/// harm. These two functions are always inlined, as GCC regards a function that only prefetches as one without
/// effect.
[[gnu::always_inline]] inline void prefetch_texels(const Texture& t, float u, float v) {
    if (t.rgb.empty() || !std::isfinite(u) || !std::isfinite(v)) return;
    const auto first_at = [](float place, int n) {
        const float part = place - std::floor(place);
        return static_cast<std::size_t>(
            std::clamp(static_cast<int>(part * static_cast<float>(n) - 0.5f), 0, n - 1));
    };
    const std::size_t row = first_at(1 - v, t.height), column = first_at(u, t.width),
                      width = static_cast<std::size_t>(t.width);
    __builtin_prefetch(&t.rgb[3 * (row * width + column)]);
    if (row + 1 < static_cast<std::size_t>(t.height)) __builtin_prefetch(&t.rgb[3 * ((row + 1) * width + column)]);
}

/// Prefetches the texels of all lanes before the first lookup, so that the memory latencies overlap.
[[gnu::always_inline]] inline void prefetch_textures(const Scene& scene, const HitBatch& hits,
                                                     std::uint32_t lanes) {
    for (std::uint32_t rest = lanes; rest != 0; rest &= rest - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(rest));
        const int texture = scene.materials[static_cast<std::size_t>(hits.material[i])].texture;
        if (texture >= 0) prefetch_texels(scene.textures[static_cast<std::size_t>(texture)], hits.u[i], hits.v[i]);
    }
}

/// Fills in the return at the end of a path. In place, as copying a struct that was just written in parts is slow.
void put_return(const Tracer& tracer, const BodyPoses& at, const HitBatch& hits, std::size_t i, const Path& path,
                const ShotSettings& settings, LidarReturn& r) {
    const Vec3 back = -path.direction;
    const Surface surface = surface_of(tracer, at, hits, i, path.direction);
    const double cosine = std::max(dot(surface.normal, back), 0.0);  // smooth normals may turn away at the limb
    const double reflectivity = std::numbers::pi * mean(bsdf(surface, surface.normal, back, back)) +
                                static_cast<double>(surface.material->retroreflectance);
    r.range_m = path.range_m;
    r.reflectivity = static_cast<float>(path.throughput * cosine * reflectivity);
    r.body = hits.body[i];
    r.cos_incidence = static_cast<float>(cosine);
    r.velocity_m_s = path.rate_m_s;
    if (is_set(settings.sunlight, i))
        r.sunlight =
            static_cast<float>(path.one_way) * sunlight_on(tracer, at, hits[i], surface, back, settings.medium);
}

/// Attenuates the path by the medium on the segment that ends at the hit, both ways.
void dim(Path& path, const BodyPoses& at, const Vec3& from, const HitBatch& hits, std::size_t i,
         const LidarMedium& medium) {
    const double passes =
        medium.transmittance(at, {from, path.direction, hits.time[i]}, norm(hits.position[i] - from));
    path.throughput *= passes * passes;
    path.one_way *= passes;
}

/// Extends the path to the hit.
void advance(Path& path, const BodyPoses& at, const HitBatch& hits, std::size_t i, const ShotSettings& settings) {
    // After a mirror, ranges of hits are measured from an offset start, so the distance between the points is used.
    const Vec3 position = hits.position[i];
    path.range_m += path.range_m > 0 ? norm(position - path.start) : hits.range_m[i];
    path.start = position;
    if (settings.motions.empty()) return;
    const Vec3 velocity = velocity_at(settings, at, hits.body[i], position, hits.time[i]);
    path.rate_m_s += dot(path.direction, velocity - path.velocity);
    path.velocity = velocity;
}

NARPA_EACH_ISA void take_to_world(const PoseLanes& T_world_mount, const Rigid3& T_mount_lidar,
                                  Vec3Lanes& __restrict origin, Vec3Lanes& __restrict direction) {
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Rigid3 T_world_lidar = T_world_mount[i] * T_mount_lidar;
        origin.put(i, T_world_lidar * origin[i]);
        direction.put(i, T_world_lidar.q * direction[i]);
    }
}

Path to_first_hit(const BodyPoses& at, const RayBatch& beams, const HitBatch& hits, std::size_t i,
                  const ShotSettings& settings) {
    Path path{.direction = beams.direction[i]};
    if (!settings.motions.empty())
        path.velocity = velocity_at(settings, at, settings.mount, beams.origin[i], beams.time[i]);
    if (settings.medium != nullptr) dim(path, at, beams.origin[i], hits, i, *settings.medium);
    advance(path, at, hits, i, settings);
    return path;
}

bool goes_on(const Tracer& tracer, const HitBatch& hits, std::size_t i, const ShotSettings& settings) {
    const Material& m = tracer.scene().materials[static_cast<std::size_t>(hits.material[i])];
    return settings.multipath && m.kind->is_mirror;
}

void reflect(Path& path, const Tracer& tracer, const HitBatch& hits, std::size_t i) {
    const Material& m = tracer.scene().materials[static_cast<std::size_t>(hits.material[i])];
    const Vec3 n = hits.shading_normal[i], d = path.direction;
    path.direction = normalized(d - 2 * dot(d, n) * n);
    path.throughput *= mean(m.specular) * mean(m.specular);
    path.one_way *= mean(m.specular);
}

/// Follows the shots whose first hits are mirrors. `hits`: the first hits.
void follow_mirrors(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, const ShotSettings& settings,
                    std::uint32_t mirrored, HitBatch hits, std::span<LidarReturn> returns) {
    Lanes<Path> paths;
    for_each_lane(mirrored, [&](std::size_t i) { paths[i] = to_first_hit(at, beams, hits, i, settings); });
    for (int mirrors = 0; mirrored != 0 && mirrors < kMirrors; ++mirrors) {
        Vec3Lanes directions;
        for_each_lane(mirrored, [&](std::size_t i) {
            reflect(paths[i], tracer, hits, i);
            directions.put(i, paths[i].direction);
        });
        tracer.intersect(at, hits, directions, mirrored, hits);
        const std::uint32_t met = mirrored & hits.met;
        mirrored = 0;
        for_each_lane(met, [&](std::size_t i) {
            Path& path = paths[i];
            if (settings.medium != nullptr) dim(path, at, path.start, hits, i, *settings.medium);
            advance(path, at, hits, i, settings);
            if (!(path.range_m < settings.range_max_m)) return;
            if (goes_on(tracer, hits, i, settings))
                mirrored |= 1u << i;
            else
                put_return(tracer, at, hits, i, path, settings, returns[i]);
        });
    }
}

}  // namespace

Vec3 velocity_at(const ShotSettings& settings, const BodyPoses& at, int body, const Vec3& point,
                 double time) noexcept {
    if (body < 0) return {};
    const auto i = static_cast<std::size_t>(body);
    const Motion& m = settings.motions[i];
    const Rigid3 T = at.T_world_body_at(i, time);
    return m.velocity_m_s + cross(T.q * m.rate_rad_s, point - T.t);
}

void place_beams(const BodyPoses& at, int mount, const Rigid3& T_mount_lidar, RayBatch& beams) noexcept {
    PoseLanes T_world_mount;
    if (mount < 0)
        T_world_mount.fill({});
    else
        poses_at(at, static_cast<std::size_t>(mount), beams.time, T_world_mount);
    take_to_world(T_world_mount, T_mount_lidar, beams.origin, beams.direction);
}

void shoot(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, const ShotSettings& settings,
           std::span<LidarReturn> returns) noexcept {
    HitBatch hits;
    shoot(tracer, at, beams, settings, returns, hits);
}

void shoot(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, const ShotSettings& settings,
           std::span<LidarReturn> returns, HitBatch& hits) noexcept {
    tracer.intersect(at, beams, settings.bodies.empty() ? tracer.all_bodies() : settings.bodies, hits);
    std::fill_n(returns.begin(), beams.n, LidarReturn{});
    const std::uint32_t met = hits.met & lanes_below(beams.n);
    if (met == 0) return;
    prefetch_textures(tracer.scene(), hits, met);
    PlainReturns plain;
    const bool nothing_on_the_way = settings.motions.empty() && settings.medium == nullptr;
    if (nothing_on_the_way) find_plain_returns(tracer, beams, hits, met, plain);
    for_each_lane(plain.lanes, [&](std::size_t i) {
        if (!(hits.range_m[i] < settings.range_max_m)) return;
        LidarReturn& r = returns[i];
        r.range_m = hits.range_m[i];
        r.reflectivity = plain.reflectivity[i];
        r.body = hits.body[i];
        r.cos_incidence = plain.cos_incidence[i];
        if (is_set(settings.sunlight, i)) {
            const Vec3 direction = beams.direction[i];
            r.sunlight =
                sunlight_on(tracer, at, hits[i], surface_of(tracer, at, hits, i, direction), -direction, nullptr);
        }
    });
    std::uint32_t mirrored = 0;
    for_each_lane(met & ~plain.lanes, [&](std::size_t i) {
        const Path path = to_first_hit(at, beams, hits, i, settings);
        if (!(path.range_m < settings.range_max_m)) return;
        if (goes_on(tracer, hits, i, settings))
            mirrored |= 1u << i;
        else
            put_return(tracer, at, hits, i, path, settings, returns[i]);
    });
    if (mirrored != 0) follow_mirrors(tracer, at, beams, settings, mirrored, hits, returns);
}

LidarReturn shoot(const Tracer& tracer, const BodyPoses& at, const Ray& beam,
                  const ShotSettings& settings) noexcept {
    RayBatch beams;
    beams.n = 1;
    beams.put(0, beam);
    LidarReturn seen;
    shoot(tracer, at, beams, settings, {&seen, 1});
    return seen;
}

}  // namespace narpa
