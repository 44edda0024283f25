#include "renderer/frame/subpixel/subpixel_bodies.h"

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "renderer/optics/lens.h"

namespace narpa {
namespace {

double largest(const Vec3& v) {
    return std::max({v.x, v.y, v.z});
}

/// Two axes that complete the unit vector z to a frame; x is the projection of `towards`, if that is not along z.
std::array<Vec3, 2> frame_about(const Vec3& z, const Vec3& towards) {
    Vec3 x = towards - dot(towards, z) * z;
    if (norm(x) < 1e-9) {
        const Vec3 any = std::abs(z.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
        x = any - dot(any, z) * z;
    }
    x = normalized(x);
    return {x, cross(z, x)};
}

}  // namespace

double spread_reach_m(const CameraModel& model, const Vec3& centre, double radius_m) noexcept {
    if (!model.project(centre)) return 0;
    const auto& [x, y] = model.jacobian(centre);
    const double largest_px_m = largest_stretch({x, y});
    if (2 * radius_m * largest_px_m >= kSubpixelWidth_px) return 0;
    const double smallest_px_m = norm(cross(x, y)) / largest_px_m;
    return (kSpreadSampleReach_px + 0.01) / smallest_px_m;
}

SubpixelBodies::SubpixelBodies(const Tracer& tracer, const BodyPoses& at, const Camera& camera,
                               const CameraModel* model, const Rigid3& T_world_camera, const Lens* lens,
                               bool moving)
    : tracer_(tracer),
      at_(at),
      model_(model),
      T_world_camera_(T_world_camera),
      lens_(lens),
      sample_reach_px_(camera.optics.point_spread ? kSpreadSampleReach_px : 0.5) {
    for (std::size_t body = 0; body < at.T_world_body.size() && !any_ && !moving; ++body)
        any_ = disc_within(static_cast<int>(body), 0, 0, camera.width - 1, camera.height - 1).has_value();
}

Vec3 SubpixelBodies::centre_camera(std::size_t body) const noexcept {
    const Rigid3& T = at_.T_world_body[body];
    // Differences of positions come first: a common offset of the whole scene cancels.
    const Vec3 centre = (T.t - T_world_camera_.t) + T.q * tracer_.bounds(body).centre_m;
    return conjugate(T_world_camera_.q) * centre;
}

double SubpixelBodies::reach_px(const Vec3& centre, double radius_m) const noexcept {
    if (!model_->project(centre)) return kInfinity;
    return radius_m * largest_stretch(model_->jacobian(centre));
}

bool SubpixelBodies::has_air(std::size_t body) const noexcept {
    const auto& air = tracer_.scene().atmosphere;
    return air && air->body == static_cast<int>(body);
}

bool SubpixelBodies::contains(int body) const noexcept {
    const std::size_t i = static_cast<std::size_t>(body);
    return !has_air(i) &&
           2 * reach_px(centre_camera(i), largest(tracer_.bounds(i).semi_axes_m)) < kSubpixelWidth_px;
}

std::optional<SubpixelDisc> SubpixelBodies::disc_within(int body, int x_first, int y_first, int x_last,
                                                        int y_last) const noexcept {
    SubpixelDisc disc;
    disc.body = static_cast<std::size_t>(body);
    const Vec3 centre = centre_camera(disc.body);
    disc.radius_px = reach_px(centre, largest(tracer_.bounds(disc.body).semi_axes_m));
    if (has_air(disc.body) || !(2 * disc.radius_px < kSubpixelWidth_px)) return std::nullopt;
    if (lens_ != nullptr) {
        auto [x, y] = model_->jacobian(centre / centre.z);
        x.z = y.z = 0;  // the aperture is perpendicular to the axis
        disc.radius_px += 0.5 * circle_of_confusion_px(*lens_, largest_stretch({x, y}), centre.z);
    }
    const auto [x, y] = *model_->project(centre);
    disc.x_px = x, disc.y_px = y;
    const double margin = disc.radius_px * (1 + 1e-3) + sample_reach_px_ + 0.01;  // 1e-3: perspective
    if (x < x_first - margin || x > x_last + margin || y < y_first - margin || y > y_last + margin)
        return std::nullopt;
    span_disc(disc);
    return disc;
}

void SubpixelBodies::span_disc(SubpixelDisc& disc) const noexcept {
    // In the space where the bounds are a unit sphere: the plane of the sphere's outline as seen by the camera, and
    // the Sun. The affine map preserves straight lines, lighting and occlusion.
    const BodyBounds& bounds = tracer_.bounds(disc.body);
    const Rigid3& T = at_.T_world_body[disc.body];
    const Vec3 eye_body = conjugate(T.q) * (T_world_camera_.t - T.t) - bounds.centre_m;
    const Vec3 eye = eye_body / bounds.semi_axes_m;
    const double distance = norm(eye);
    const Vec3 z = eye / distance;
    Vec3 to_sun{};
    if (const auto& sun = tracer_.scene().sun) {
        to_sun = normalized(conjugate(T.q) * sun->direction / bounds.semi_axes_m);
        // The whole disc of the Sun counts: its upper edge rises first.
        const double phase = std::atan2(norm(cross(to_sun, z)), dot(to_sun, z));
        disc.lit = 0.5 * (1 + std::cos(std::max(0.0, phase - 0.5 * sun->angular_diameter_rad)));
    }
    const auto [x, y] = frame_about(z, to_sun);
    const double radius = std::sqrt(std::max(0.0, 1 - 1 / (distance * distance)));
    const auto to_world = [&](const Vec3& p) { return T.q * (p * bounds.semi_axes_m); };
    disc.centre = (T.t - T_world_camera_.t) + T.q * bounds.centre_m + to_world(z / distance);
    disc.right = to_world(radius * x);
    disc.up = to_world(radius * y);
}

Hit SubpixelBodies::beyond(const Ray& ray, Hit hit) const noexcept {
    // Rays pass through subpixel bodies as if these were not there. They may meet several, even one of them twice;
    // a ray through more than kSurfaces of their surfaces hits nothing.
    constexpr int kSurfaces = 64;
    double travelled_m = 0;
    for (int i = 0; i < kSurfaces && hit.body >= 0 && contains(hit.body); ++i) {
        travelled_m += hit.range_m;
        hit =
            tracer_.intersect(at_, {ray.origin + travelled_m * ray.direction, ray.direction}, kInfinity, hit.body);
    }
    if (hit.body < 0 || contains(hit.body)) return Hit{};
    hit.range_m += travelled_m;
    return hit;
}

}  // namespace narpa
