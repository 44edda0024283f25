#include "renderer/lidar/diffuse_multipath.h"

#include <cmath>
#include <numbers>

#include "renderer/integrator/sampler.h"
#include "renderer/integrator/shading.h"

namespace narpa {
namespace {

/// Frame numbers of the sampler, distinct from those of camera pixels.
constexpr std::uint32_t kLidarStream = 0x4c000000u;

/// The value of the LiDAR's single band: the mean of the three.
double one_band(const Rgb& c) {
    return static_cast<double>(mean_band(c));
}

/// Rays that continue from the points B where sub-rays end.
struct BounceRays {
    std::uint32_t wanted = 0;
    Vec3Lanes direction;
    Lanes<double> weight;  ///< f cosine / pdf
};

/// The surfaces A that such rays hit, as seen from the LiDAR.
struct SecondSurfaces {
    std::uint32_t lanes = 0;
    Vec3Lanes to_lidar;
    Lanes<double> distance_m, light;
};

void choose_bounce(const Tracer& tracer, const BodyPoses& at, const Hit& hit, const Vec3& direction,
                   const SamplePoint& u, std::size_t i, BounceRays& out) {
    const Surface surface = surface_at(tracer, at, hit, direction, 0);
    const BsdfSample sample = sample_bsdf(surface, surface.normal, -direction, {u[2], u[0], u[1]});
    const double weight = one_band(sample.weight);
    if (sample.specular || sample.transmitted || !(weight > 0) || !(dot(sample.l, hit.geometric_normal) > 0))
        return;
    out.wanted |= 1u << i;
    out.direction.put(i, sample.l);
    out.weight[i] = weight;
}

/// Stores the light of surface A as if the pulse lit it and nothing occluded it: the caller tests both.
void put_second_surface(const Tracer& tracer, const BodyPoses& at, const Ray& ray, const BounceRays& bounces,
                        const Hit& hit, std::size_t i, SecondSurfaces& out) {
    const Vec3 home = ray.origin - hit.position;
    const double distance_m = norm(home);
    const Vec3 to_lidar = home / distance_m;
    out.to_lidar.put(i, to_lidar);
    out.distance_m[i] = distance_m;
    const Surface surface = surface_at(tracer, at, hit, bounces.direction[i], 0);
    const double cosine = dot(surface.normal, to_lidar);
    const double f = one_band(bsdf(surface, surface.normal, to_lidar, -bounces.direction[i]));
    out.light[i] = std::numbers::pi * bounces.weight[i] * f * cosine / (distance_m * distance_m);
    if (out.light[i] > 0) out.lanes |= 1u << i;
}

/// Path from the LiDAR to B, to A and back to the LiDAR. Light travels it in reverse, with the same result.
struct Way {
    Ray there, across, home;
};

/// Half the rate of change of the path's length, as ranges are half of it.
double half_rate(const ShotSettings& settings, const BodyPoses& at, const Way& way, int body_b, int body_a) {
    const Vec3 lidar = velocity_at(settings, at, settings.mount, way.there.origin, way.there.time),
               b = velocity_at(settings, at, body_b, way.across.origin, way.across.time),
               a = velocity_at(settings, at, body_a, way.home.origin, way.home.time);
    return 0.5 * (dot(way.there.direction, b - lidar) + dot(way.across.direction, a - b) +
                  dot(way.home.direction, lidar - a));
}

}  // namespace

DiffuseMultipath::DiffuseMultipath(const Tracer& tracer, const Lidar& lidar, std::uint64_t seed, std::size_t index,
                                   std::size_t sub_rays)
    : tracer_(tracer),
      mount_(lidar.mount),
      q_mount_lidar_(lidar.T_mount_lidar.q),
      cos_beam_(std::cos(0.5 * lidar.receiver.beam_divergence_rad)),
      sub_rays_(sub_rays),
      seed_(seed),
      stream_(kLidarStream + static_cast<std::uint32_t>(index)) {
    if (lidar.receiver.multipath != LidarReceiverModel::Multipath::diffuse) return;
    if (lidar.model) lit_ = lidar.model->spec().lit;
    rays_each_ = sub_rays < kRays ? (kRays + sub_rays - 1) / sub_rays : 1;
    late_.resize(kLanes * sub_rays * rays_each_);
}

bool DiffuseMultipath::is_lit(const BodyPoses& at, double time, const Vec3& axis,
                              const Vec3& direction) const noexcept {
    if (lit_.kind == LidarField::Kind::beam) return dot(axis, direction) >= cos_beam_;
    Quat q = q_mount_lidar_;
    if (mount_ >= 0) q = at.T_world_body_at(static_cast<std::size_t>(mount_), time).q * q;
    return lit_.contains(conjugate(q) * direction);
}

void DiffuseMultipath::trace(const BodyPoses& at, const RayBatch& rays, const SubRays& sub_rays,
                             const HitBatch& hits, std::span<const LidarReturn> returns,
                             const ShotSettings& settings) noexcept {
    for (std::size_t n = 0; n < rays_each_; ++n) {
        BounceRays bounces;
        for (std::size_t i = 0; i < rays.n; ++i) {
            late_[sub_rays.place[i] * rays_each_ + n] = {};
            if (!is_set(hits.met, i) || !(returns[i].range_m > 0)) continue;
            const PixelSampler sampler(seed_ ^ (sub_rays.shot[i] >> 32), stream_,
                                       static_cast<std::uint32_t>(sub_rays.shot[i]));
            const auto sample = static_cast<std::uint32_t>(n * sub_rays_ + sub_rays.of_beam[i]);
            choose_bounce(tracer_, at, hits[i], rays.direction[i], sampler.point(sample), i, bounces);
        }
        if (bounces.wanted == 0) continue;
        HitBatch seconds;
        tracer_.intersect(at, hits, bounces.direction, bounces.wanted, seconds);
        SecondSurfaces lit;
        for_each_lane(bounces.wanted & seconds.met, [&](std::size_t i) {
            put_second_surface(tracer_, at, rays[i], bounces, seconds[i], i, lit);
            if (!is_lit(at, rays.time[i], sub_rays.axis[i], -lit.to_lidar[i])) lit.lanes &= ~(1u << i);
        });
        if (lit.lanes == 0) continue;
        lit.lanes &= ~tracer_.occluded(at, seconds, lit.to_lidar, lit.distance_m, lit.lanes);
        for_each_lane(lit.lanes, [&](std::size_t i) {
            const double range_m = 0.5 * (returns[i].range_m + seconds.range_m[i] + lit.distance_m[i]);
            if (!(range_m < settings.range_max_m)) return;
            const Way way{rays[i],
                          {hits.position[i], bounces.direction[i], rays.time[i]},
                          {seconds.position[i], lit.to_lidar[i], rays.time[i]}};
            double light = lit.light[i];
            if (settings.medium != nullptr)
                light *= settings.medium->transmittance(at, way.there, returns[i].range_m) *
                         settings.medium->transmittance(at, way.across, seconds.range_m[i]) *
                         settings.medium->transmittance(at, way.home, lit.distance_m[i]);
            LidarReturn& r = late_[sub_rays.place[i] * rays_each_ + n];
            r.range_m = range_m;
            r.reflectivity = static_cast<float>(light * range_m * range_m);
            r.body = hits.body[i];
            if (!settings.motions.empty())
                r.velocity_m_s = half_rate(settings, at, way, hits.body[i], seconds.body[i]);
        });
    }
}

}  // namespace narpa
