#include "renderer/camera/camera_model.h"

#include <algorithm>
#include <array>

#include "base/each_isa.h"

namespace narpa {
namespace {

/// `out` overlaps with nothing: results are gathered in an array that the compiler knows to be alone.
NARPA_EACH_ISA void pinhole_directions(const Pinhole& pinhole, const Quat& q, const Lanes<double>& x,
                                       const Lanes<double>& y, Vec3Lanes& out) noexcept {
    Vec3Lanes direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 d = q * pinhole.direction({x[i], y[i]});
        direction.x[i] = d.x, direction.y[i] = d.y, direction.z[i] = d.z;
    }
    out = direction;
}

}  // namespace

double largest_stretch(const ProjectionJacobian& J) noexcept {
    const double xx = dot(J.x, J.x), yy = dot(J.y, J.y), xy = dot(J.x, J.y);
    return std::sqrt(0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy));
}

void CameraModel::directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                             Vec3Lanes& out) const noexcept {
    for (std::size_t i = 0; i < kLanes; ++i) out.put(i, q * direction({x[i], y[i]}));
}

double CameraModel::pixels_per_sr(const Vec3& d) const noexcept {
    const auto [x, y] = jacobian(d);
    return norm(cross(x, y));
}

void Pinhole::directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                         Vec3Lanes& out) const noexcept {
    pinhole_directions(*this, q, x, y, out);
}

/// About the ray through the middle, as wide as the widest corner: a cone of less than 90 degrees cuts the image
/// plane in a convex figure.
DirectionCone Pinhole::bounds(const ImageRect& r) const noexcept {
    DirectionCone cone{direction({0.5 * (r.x_low + r.x_high), 0.5 * (r.y_low + r.y_high)}), 0};
    for (const double x : {r.x_low, r.x_high})
        for (const double y : {r.y_low, r.y_high}) {
            const Vec3 corner = on_plane({x, y});
            cone.half_angle_rad =
                std::max(cone.half_angle_rad, std::atan2(norm(cross(cone.axis, corner)), dot(cone.axis, corner)));
        }
    return cone;
}

std::shared_ptr<const CameraModel> Pinhole::scaled(double x, double y) const {
    return std::make_shared<Pinhole>(with_scale(x, y));
}
std::shared_ptr<const CameraModel> Pinhole::windowed(double x, double y) const {
    return std::make_shared<Pinhole>(with_origin(x, y));
}

namespace {

void set_intrinsics(Camera& camera, const Pinhole& p) {
    camera.fx = p.fx, camera.fy = p.fy, camera.cx = p.cx, camera.cy = p.cy;
}

}  // namespace

Camera scaled(const Camera& camera, double factor_x, double factor_y) {
    constexpr double kRounding = 1e-9;
    Camera c = camera;
    c.width = static_cast<int>(camera.width * factor_x * (1 + kRounding));
    c.height = static_cast<int>(camera.height * factor_y * (1 + kRounding));
    set_intrinsics(c, Pinhole(camera).with_scale(factor_x, factor_y));
    if (camera.model) c.model = camera.model->scaled(factor_x, factor_y);
    return c;
}

Camera windowed(const Camera& camera, int x, int y, int width, int height) {
    Camera c = camera;
    c.width = width, c.height = height;
    set_intrinsics(c, Pinhole(camera).with_origin(x, y));
    if (camera.model) c.model = camera.model->windowed(x, y);
    return c;
}

}  // namespace narpa
