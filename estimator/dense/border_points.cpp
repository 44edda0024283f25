#include "estimator/dense/border_points.h"

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

Camera finer_camera(const Camera& camera, int factor) {
    Camera c = scaled(camera, factor, factor);
    c.lens.reset();
    return c;
}

FrameSettings one_ray(FrameSettings settings) {
    settings.spp = 1;
    settings.budget = {};
    return settings;
}

}  // namespace

Ray ray_through(const Frame& f, double x, double y) {
    return camera_ray(f.model, f.pose.at(f.pose.time(y, f.camera.height, 0.5)), x, y);
}

FineGrid::FineGrid(const RenderScene& render_scene, const BodyPoses& at, const Camera& pixels,
                   const CameraPose& path, const FrameSettings& for_all, int factor)
    : fineness(factor),
      camera(finer_camera(pixels, factor)),
      settings(one_ray(for_all)),
      frame(make_frame(render_scene, at, camera, path, settings)) {}

PointTracer::PointTracer(const FineGrid& grid, const SensorModel& sensor)
    : grid_(grid), f_(grid.frame), sensor_(sensor) {
    p_.sample.fill(0);
    if (f_.sun) p_.to_sun.fill(f_.sun->centre());
}

void PointTracer::put(double x, double y, RaySample& seen) {
    x_[n_] = x, y_[n_] = y;
    p_.number[n_] = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(grid_.camera.width) +
                    static_cast<std::uint32_t>(x);
    seen_[n_++] = &seen;
    if (n_ == kLanes) trace();
}

void PointTracer::trace() {
    if (n_ == 0) return;
    p_.rays.n = n_;
    if (f_.over_time)
        for (std::size_t i = 0; i < n_; ++i) p_.rays.put(i, ray_through(f_, x_[i], y_[i]));
    else
        f_.model->directions(f_.T_world_camera.q, x_, y_, p_.rays.direction),
            p_.rays.origin.fill(f_.T_world_camera.t);
    f_.tracer.intersect(f_.at, p_.rays, f_.tracer.all_bodies(), p_.hits);
    if (f_.subpixel_bodies.any())
        for (std::size_t i = 0; i < n_; ++i) p_.hits.put(i, f_.subpixel_bodies.beyond(p_.rays[i], p_.hits[i]));
    RgbLanes radiance;
    f_.integrator.radiance(f_, p_, radiance);
    for (std::size_t i = 0; i < n_; ++i) {
        RaySample& seen = *seen_[i];
        seen = {sensor_.signal(radiance[i]), -1, kInfinity, {}, {}, p_.rays.direction[i]};
        if (p_.hits.body[i] < 0) continue;
        seen.body = p_.hits.body[i];
        seen.range_m = p_.hits.range_m[i];
        seen.position = p_.hits.position[i];
        seen.normal = p_.hits.geometric_normal[i];
    }
    n_ = 0;
}

void BorderPoints::trace(PointTracer& tracer, int width, std::span<const std::uint8_t> chosen) {
    const auto is_chosen = [&](int c, int r) {
        return c >= 0 && r >= 0 && c < square_.columns && r < square_.rows &&
               chosen[index_in(width, square_.x + c, square_.y + r)] != 0;
    };
    for (int r = 0; r <= square_.rows; ++r)
        for (int c = 0; c <= square_.columns; ++c) {
            const int x = (square_.x + c) * n_, y = (square_.y + r) * n_;
            if (is_chosen(c, r - 1) || is_chosen(c, r))
                for (int i = 0; i < n_; ++i) tracer.put(x + i, y - 0.5, upper_[index(c, r, i)]);
            if (is_chosen(c - 1, r) || is_chosen(c, r))
                for (int i = 0; i < n_; ++i) tracer.put(x - 0.5, y + i, left_[index(c, r, i)]);
        }
    tracer.trace();
}

}  // namespace narpa
