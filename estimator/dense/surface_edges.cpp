#include "estimator/dense/surface_edges.h"

#include <algorithm>
#include <cmath>

#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

/// Neighbouring points of one surface are at most this many times as far apart as its slope predicts.
constexpr double kSurfaceSteps = 2.5;
/// Lower limit of the cosine between ray and normal in that prediction.
constexpr double kMinCosine = 0.02;

/// Inverse range of a point's tangent plane along another ray.
double inverse_range_towards(const RaySample& point, const Vec3& direction) {
    return dot(point.normal, direction) / (point.range_m * dot(point.normal, point.ray_direction));
}

void halve_interval(Contour& c, int body, double here_m) {
    if (body >= 0 && (body != c.far->body || std::abs(here_m - c.range_m) < std::abs(here_m - c.far->range_m)))
        c.on_near = c.middle(), c.range_m = here_m;
    else
        c.on_far = c.middle();
}

}  // namespace

Ray ray_through(const Frame& f, double x, double y) {
    return camera_ray(f.camera, f.pose.at(f.pose.time(y, f.camera.height, 0.5)), x, y);
}

void aim_through(const Frame& f, const Lanes<double>& x, const Lanes<double>& y, RayBatch& rays) {
    if (f.over_time)
        for (std::size_t i = 0; i < rays.n; ++i) rays.put(i, ray_through(f, x[i], y[i]));
    else
        f.model->directions(f.T_world_camera.q, x, y, rays.direction), rays.origin.fill(f.T_world_camera.t);
}

bool is_contour(const RaySample& a, const RaySample& b) {
    if (a.body != b.body) return true;
    const double cosine = std::max(
        std::min(std::abs(dot(a.normal, a.ray_direction)), std::abs(dot(b.normal, b.ray_direction))), kMinCosine);
    const double range_m = kSurfaceSteps * std::max(a.range_m, b.range_m);
    const Vec3 apart = a.position - b.position, turn = a.ray_direction - b.ray_direction;
    return dot(apart, apart) * cosine * cosine > range_m * range_m * dot(turn, turn);
}

EdgePlace edge_between(const RaySample& a, const RaySample& b) {
    const double at_a = 1 / a.range_m, at_b = 1 / b.range_m;
    const double off_b_at_a = at_a - inverse_range_towards(b, a.ray_direction);
    const double off_a_at_b = at_b - inverse_range_towards(a, b.ray_direction);
    const double along = off_b_at_a / (off_b_at_a + off_a_at_b);
    if (!(along > 0 && along < 1)) return {0.5, 2 / (at_a + at_b)};
    return {along, 1 / (at_a + along * (at_b - off_a_at_b - at_a))};
}

void bisect(const Frame& f, std::span<Contour> contours, int halvings) {
    RayBatch rays;
    HitBatch hits;
    Lanes<double> x{}, y{};
    for (std::size_t first = 0; first < contours.size(); first += kLanes) {
        const auto batch = contours.subspan(first, std::min(kLanes, contours.size() - first));
        rays.n = batch.size();
        for (int k = 0; k < halvings; ++k) {
            for (std::size_t i = 0; i < batch.size(); ++i) {
                const Contour& c = batch[i];
                x[i] = c.x + c.middle() * c.dx, y[i] = c.y + c.middle() * c.dy;
            }
            aim_through(f, x, y, rays);
            f.tracer.intersect(f.at, rays, f.tracer.all_bodies(), hits);
            for (std::size_t i = 0; i < batch.size(); ++i) halve_interval(batch[i], hits.body[i], hits.range_m[i]);
        }
    }
}

}  // namespace narpa
