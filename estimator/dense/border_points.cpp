#include "estimator/dense/border_points.h"

#include <cmath>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

Camera finer_camera(const Camera& camera, int factor) {
    Camera c = scaled(camera, factor, factor);
    c.optics.lens.reset();
    return c;
}

FrameSettings one_ray(FrameSettings settings) {
    settings.spp = 1;
    settings.budget = {};
    return settings;
}

}  // namespace

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
    aim_through(f_, x_, y_, p_.rays);
    f_.tracer.intersect(f_.at, p_.rays, f_.tracer.all_bodies(), p_.hits);
    if (f_.subpixel_bodies.any())
        for (std::size_t i = 0; i < n_; ++i) p_.hits.put(i, f_.subpixel_bodies.beyond(p_.rays[i], p_.hits[i]));
    RgbLanes radiance;
    f_.integrator.radiance(f_.transport, p_, radiance);
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

void BorderPoints::trace(const FineGrid& grid, PointTracer& tracer, int width,
                         std::span<const std::uint8_t> chosen) {
    const auto is_chosen = [&](int c, int r) {
        return c >= 0 && r >= 0 && c < square_.columns && r < square_.rows &&
               chosen[index_in(width, square_.x + c, square_.y + r)] != 0;
    };
    // A point is needed where it, or a neighbour on its line, is on the border of a chosen pixel.
    const auto serves = [&](int k, auto&& on_border_of) {
        return on_border_of((k + n_) / n_ - 1) || on_border_of((k - 1 + n_) / n_ - 1) ||
               on_border_of((k + 1 + n_) / n_ - 1);
    };
    const int x = square_.x * n_, y = square_.y * n_;
    for (int c = 0; c <= square_.columns; ++c)
        for (int k = -1; k <= left_.n; ++k)
            if (serves(k, [&](int r) { return is_chosen(c - 1, r) || is_chosen(c, r); }))
                tracer.put(x + c * n_ - 0.5, y + k, left_.at(c, k));
    for (int r = 0; r <= square_.rows; ++r)
        for (int k = -1; k <= upper_.n; ++k)
            if (serves(k, [&](int c) { return is_chosen(c, r - 1) || is_chosen(c, r); }))
                tracer.put(x + k, y + r * n_ - 0.5, upper_.at(r, k));
    tracer.trace();
    find_shifts(grid);
}

void BorderPoints::find_shifts(const FineGrid& grid) {
    std::vector<Contour> contours;
    std::vector<Step> steps;
    const auto look = [&](Lines& lines, int line, int k, double x, double y, double dx, double dy) {
        const RaySample &a = lines.at(line, k), &b = lines.at(line, k + 1);
        if (a.range_m == 0 || b.range_m == 0 || a.signal == b.signal) return;  // 0: not traced
        const bool near_is_a = a.range_m <= b.range_m;
        const RaySample &near = near_is_a ? a : b, &far = near_is_a ? b : a;
        if (near.body < 0 || near.body == grid.camera.mount) return;
        const Step step{&lines, lines.index(line, k)};
        if (!is_contour(a, b)) return add_shift(step, edge_between(a, b));
        steps.push_back(step);
        contours.push_back(near_is_a ? Contour{x, y, dx, dy, &near, &far}
                                     : Contour{x + dx, y + dy, -dx, -dy, &near, &far});
    };
    const int x = square_.x * n_, y = square_.y * n_;
    for (int c = 0; c <= square_.columns; ++c)
        for (int k = -1; k < left_.n; ++k) look(left_, c, k, x + c * n_ - 0.5, y + k, 0, 1);
    for (int r = 0; r <= square_.rows; ++r)
        for (int k = -1; k < upper_.n; ++k) look(upper_, r, k, x + k, y + r * n_ - 0.5, 1, 0);
    bisect(grid.frame, contours, grid.halvings);
    for (std::size_t i = 0; i < contours.size(); ++i) {
        const Contour& c = contours[i];
        add_shift(steps[i], {c.dx + c.dy > 0 ? c.middle() : 1 - c.middle(), c.range_m});
    }
}

/// A point represents the line halfway to its neighbours.
void BorderPoints::add_shift(const Step& step, const EdgePlace& edge) {
    const RaySample *a = &step.lines->points[step.first], *b = a + 1;
    const double change = (edge.along - 0.5) * (a->signal - b->signal);
    BorderShift& shift = step.lines->shifts[step.first + (edge.along < 0.5 ? 0 : 1)];
    if (std::abs(change) > std::abs(shift.signal)) shift.range_m = edge.range_m;
    shift.signal += change;
}

}  // namespace narpa
