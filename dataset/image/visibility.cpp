#include "dataset/image/visibility.h"

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"

namespace narpa::dataset {

bool is_in_image(const Camera& camera, const ImagePoint& p) {
    return p.x >= -0.5 && p.y >= -0.5 && p.x < camera.width - 0.5 && p.y < camera.height - 0.5 &&
           camera.model->sees(p);
}

std::vector<KeypointView> view_keypoints(const ImageScene& scene, const Placement& placement,
                                         const std::vector<Vec3>& points) {
    constexpr double kDepthTolerance = 1e-3;  // of the target's radius
    const Camera& camera = scene.camera();
    const std::size_t target = scene.roles().target;
    const double tolerance_m = kDepthTolerance * scene.tracer().bounding_radius_m(target);
    const BodyPoses at = placement.poses();
    std::vector<KeypointView> views;
    for (const Vec3& point : points) {
        KeypointView view;
        const Vec3 line = placement.T_world_body[target] * point - placement.T_world_camera.t;  // world axes
        view.px = camera.model->project(conjugate(placement.T_world_camera.q) * line);
        if (view.px && is_in_image(camera, *view.px)) {
            const double range_m = norm(line);
            const Ray ray{placement.T_world_camera.t, line / range_m};
            const bool is_hidden = scene.tracer().intersect(at, ray, range_m - tolerance_m).body >= 0;
            view.state = is_hidden ? KeypointView::State::occluded : KeypointView::State::visible;
        }
        views.push_back(view);
    }
    return views;
}

double visible_part(const ImageScene& scene, const Placement& placement) {
    constexpr int kSide = 64;
    const Camera& camera = scene.camera();
    const std::size_t target = scene.roles().target;
    const Tracer& tracer = scene.tracer();
    const BodyBounds& bounds = tracer.bounds(target);
    const Vec3 middle = placement.T_world_body[target] * bounds.centre_m - placement.T_world_camera.t;
    const double radius_m = std::max({bounds.semi_axes_m.x, bounds.semi_axes_m.y, bounds.semi_axes_m.z});
    const double reach_rad = radius_m < norm(middle) ? std::asin(radius_m / norm(middle)) : kPi;
    const Quat q_world_line = shortest_rotation({0, 0, 1}, normalized(middle));
    const Quat q_camera_world = conjugate(placement.T_world_camera.q);
    const BodyPoses at = placement.poses();
    const std::array<std::uint32_t, 1> only{static_cast<std::uint32_t>(target)};
    double all = 0, visible = 0;
    Lanes<double> solid_angle{};
    RayBatch rays;
    HitBatch own, nearest;
    const auto trace = [&] {
        tracer.intersect(at, rays, only, own);
        tracer.intersect(at, rays, tracer.all_bodies(), nearest);
        for (std::size_t k = 0; k < rays.n; ++k) {
            if (own.body[k] < 0) continue;
            all += solid_angle[k];
            const auto px = camera.model->project(q_camera_world * rays.direction[k]);
            if (px && is_in_image(camera, *px) && nearest.body[k] == static_cast<int>(target))
                visible += solid_angle[k];
        }
        rays.n = 0;
    };
    for (int i = 0; i < kSide * kSide;
         ++i) {  // the angle from the line is proportional to the distance from the middle
        const double x = (2 * (i % kSide) + 1.0) / kSide - 1, y = (2 * (i / kSide) + 1.0) / kSide - 1;
        const double r = std::hypot(x, y), angle_rad = r * reach_rad;
        if (r > 1) continue;
        const double sine = std::sin(angle_rad);
        solid_angle[rays.n] = sine / r;
        rays.put(rays.n++, {placement.T_world_camera.t,
                            normalized(q_world_line * Vec3{sine * x / r, sine * y / r, std::cos(angle_rad)})});
        if (rays.n == kLanes) trace();
    }
    if (rays.n > 0) trace();
    return all > 0 ? visible / all : 0;
}

}  // namespace narpa::dataset
