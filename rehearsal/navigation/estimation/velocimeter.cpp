#include "rehearsal/navigation/estimation/velocimeter.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace narpa::rehearsal {
namespace {

constexpr double kMinWidth_m = 0.2;  ///< smallest width of the surface that is approximated by a plane

}  // namespace

Velocimeter::Velocimeter(const SceneModel& model, std::size_t lidar, const Navigation& map)
    : model_(model),
      lidar_(model.scene().lidars[lidar]),
      index_(lidar),
      map_sigma_m_(map.map_sigma_m),
      map_correlation_m_(map.map_correlation_m) {
    const BodyBounds& target = model.tracer().bounds(model.target());
    target_centre_m_ = target.centre_m;
    target_radius_m_ = std::max({target.semi_axes_m.x, target.semi_axes_m.y, target.semi_axes_m.z});
    std::vector<LidarShot> shots(lidar_.model->spec().shots_per_packet);
    for (std::int64_t packet = 0; lidar_.model->sweep(packet) == 0; ++packet) {
        lidar_.model->shots(packet, shots);
        for (const LidarShot& shot : shots) {
            const auto beam = static_cast<std::size_t>(shot.beam);
            if (beam >= beams_.size()) beams_.resize(beam + 1);
            beams_[beam] = shot;
        }
    }
    measured_m_.resize(beams_.size());
}

std::optional<TargetVelocity> Velocimeter::measure(const LidarBeamReport& report,
                                                   const Rigid3& T_chaser_target) const {
    if (!(report.range_m > 0) || !std::isfinite(report.velocity_m_s) || report.beam >= beams_.size())
        return std::nullopt;
    const LidarShot& shot = beams_[report.beam];
    TargetVelocity v{.t_ns = report.t_ns,
                     .origin_m = lidar_.T_mount_lidar * shot.origin_m,
                     .direction = lidar_.T_mount_lidar.q * shot.direction,
                     .range_m = report.range_m,
                     .velocity_m_s = report.velocity_m_s,
                     .sigma_m_s = std::hypot(lidar_.receiver.velocity_noise_m_s,
                                             lidar_.model->spec().velocity_resolution_m_s / std::sqrt(12.0))};
    const Vec3 point = v.origin_m + v.range_m * v.direction;
    if (norm(point - T_chaser_target * target_centre_m_) > target_radius_m_) return std::nullopt;
    return v;
}

std::optional<TargetRange> Velocimeter::measure_range(const LidarBeamReport& report, const Rigid3& T_chaser_target,
                                                      double position_sigma_m) {
    if (!(report.range_m > 0) || report.beam >= beams_.size()) return std::nullopt;
    const LidarShot& shot = beams_[report.beam];
    TargetRange r{.t_ns = report.t_ns,
                  .origin_m = lidar_.T_mount_lidar * shot.origin_m,
                  .direction = lidar_.T_mount_lidar.q * shot.direction,
                  .range_m = report.range_m};
    const Rigid3 T_target_chaser = inverse(T_chaser_target);
    const Vec3 origin = T_target_chaser * r.origin_m, u = T_target_chaser.q * r.direction;
    // The plane through the hits of the beam and of rays beside it, as far apart as the pose is uncertain.
    const double width_m = std::max(kMinWidth_m, position_sigma_m);
    const Vec3 x = normalized(cross(u, std::abs(u.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0})), y = cross(u, x);
    std::array<Vec3, 5> points;
    constexpr std::array<std::array<double, 2>, 5> kOffsets{{{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Vec3 from = origin + width_m * (kOffsets[i][0] * x + kOffsets[i][1] * y);
        const auto range_m = range_in_model(from, u);
        if (!range_m) return std::nullopt;
        points[i] = from + *range_m * u;
    }
    const Vec3 mean = 0.25 * (points[1] + points[2] + points[3] + points[4]);
    r.normal = normalized(cross(points[1] - points[2], points[3] - points[4]));
    r.point_m = points[0];
    std::optional<Vec3>& measured = measured_m_[report.beam];
    if (measured && norm(points[0] - *measured) < map_correlation_m_) return std::nullopt;
    measured = points[0];
    // Second differences: deviation of the surface from a plane within that width.
    const double bend_m = std::abs(dot(mean - points[0], u));
    const double twist_m = 0.25 * std::abs(dot(points[1] + points[2] - points[3] - points[4], u));
    r.sigma_m = std::hypot(lidar_.receiver.range_noise_m, lidar_.model->spec().range_resolution_m / std::sqrt(12.0),
                           std::hypot(bend_m, twist_m, map_sigma_m_));
    return r;
}

std::optional<double> Velocimeter::range_in_model(const Vec3& origin_m, const Vec3& direction) const {
    BodyPoses at(model_.scene().bodies.size());  // the target's axes
    const auto target = static_cast<std::uint32_t>(model_.target());
    RayBatch ray;
    HitBatch hit;
    ray.n = 1;
    ray.put(0, {origin_m, direction});
    model_.tracer().intersect(at, ray, {&target, 1}, hit);
    if ((hit.met & 1) == 0) return std::nullopt;
    return hit.range_m[0];
}

}  // namespace narpa::rehearsal
