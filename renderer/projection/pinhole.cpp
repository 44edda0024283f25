#include "renderer/projection/pinhole.h"

#include <algorithm>

#include "base/each_isa.h"
#include "renderer/projection/projection_kind.h"

namespace narpa {
namespace {

/// Results are gathered in a local array, which the compiler knows not to alias anything.
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

void Pinhole::directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                         Vec3Lanes& out) const noexcept {
    pinhole_directions(*this, q, x, y, out);
}

/// Around the ray through the middle, as wide as the farthest corner: a cone of less than 90 degrees intersects the
/// image plane in a convex region, which contains the rectangle.
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

ProjectionParameters Pinhole::parameters() const {
    return {.kind = &kPinhole, .pinhole = *this};
}

Pinhole paraxial_pinhole(const CameraModel& model) {
    const Pinhole p = model.parameters().pinhole;
    const double to_axis = model.pixels_per_radian() / p.fx;
    return {p.fx * to_axis, p.fy * to_axis, p.cx, p.cy};
}

constinit const ProjectionKind kPinhole{
    .name = "pinhole", .make = [](const Pinhole& pinhole, std::span<const double>) {
        return std::shared_ptr<const CameraModel>(std::make_shared<Pinhole>(pinhole));
    }};

}  // namespace narpa
