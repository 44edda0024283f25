#include "estimator/dense/pixel_patch.h"

#include "base/constants.h"

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

double signal_of(const SensorModel& sensor, const Rgb& L) {
    const auto& k = sensor.dn_per_radiance;
    return k[0] * static_cast<double>(L.x) + k[1] * static_cast<double>(L.y) + k[2] * static_cast<double>(L.z);
}

FineGrid::FineGrid(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                   const Rigid3& T_world_camera, const FrameSettings& settings, int fineness)
    : fineness_(fineness),
      camera_(finer_camera(camera, fineness)),
      T_world_camera_(T_world_camera),
      settings_(one_ray(settings)),
      frame_(make_frame(render_scene, at, camera_, T_world_camera_, settings_)) {}

void PixelPatch::trace(const FineGrid& grid, const SensorModel& sensor, int x, int y) {
    const int s = grid.fineness();
    const Frame& f = grid.frame();
    side_ = s + 2;
    points_.resize(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_));
    sees_anything_ = false;
    Packet p;
    CameraSamples samples;
    samples.centre = true;
    samples.sample.fill(0);
    samples.path.fill(0);
    Lanes<std::size_t> place;
    const auto trace = [&] {
        RgbLanes radiance;
        trace_rays(f, samples, f.tracer.all_bodies(), p);
        f.integrator.radiance(f, p, radiance);
        for (std::size_t i = 0; i < samples.n; ++i) {
            RaySample& seen = points_[place[i]];
            seen = {signal_of(sensor, radiance[i]), -1, kInfinity, {}, {}, p.rays.direction[i]};
            if (p.hits.body[i] < 0) continue;
            sees_anything_ = true;
            seen.body = p.hits.body[i];
            seen.range_m = p.hits.range_m[i];
            seen.position = p.hits.position[i];
            seen.normal = p.hits.geometric_normal[i];
        }
        samples.n = 0;
    };
    for (int j = -1; j <= s; ++j)
        for (int i = -1; i <= s; ++i) {
            if ((i == -1 || i == s) && (j == -1 || j == s)) continue;
            const int fine_x = x * s + i, fine_y = y * s + j;
            samples.x[samples.n] = fine_x, samples.y[samples.n] = fine_y;
            samples.number[samples.n] =
                static_cast<std::uint32_t>(fine_y) * static_cast<std::uint32_t>(grid.camera().width) +
                static_cast<std::uint32_t>(fine_x);
            place[samples.n++] =
                static_cast<std::size_t>(j + 1) * static_cast<std::size_t>(side_) + static_cast<std::size_t>(i + 1);
            if (samples.n == kLanes) trace();
        }
    if (samples.n > 0) trace();
}

}  // namespace narpa
