#include "renderer/projection/camera_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/projection/projection_kind.h"

namespace narpa {

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

ProjectionParameters CameraModel::parameters() const {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    return {.kind = nullptr, .pinhole = {kNaN, kNaN, kNaN, kNaN}};
}

RectBorder border_of(const ImageRect& r) noexcept {
    constexpr std::size_t kPerEdge = kLanes / 4;
    RectBorder p;
    for (std::size_t i = 0; i < kPerEdge; ++i) {
        const double part = static_cast<double>(i) / kPerEdge;
        const double along_x = part * (r.x_high - r.x_low), along_y = part * (r.y_high - r.y_low);
        p.x[i] = r.x_low + along_x, p.y[i] = r.y_low;
        p.x[kPerEdge + i] = r.x_high, p.y[kPerEdge + i] = r.y_low + along_y;
        p.x[2 * kPerEdge + i] = r.x_high - along_x, p.y[2 * kPerEdge + i] = r.y_high;
        p.x[3 * kPerEdge + i] = r.x_low, p.y[3 * kPerEdge + i] = r.y_high - along_y;
    }
    return p;
}

/// Between two of the points the border deviates from the nearer one by half their distance, and a little more
/// where it is curved. The interior lies within, because the projection does not fold where the camera sees.
DirectionCone cone_about_border(const Vec3& axis, const Vec3Lanes& border) noexcept {
    constexpr double kStray = 0.6;
    const auto chord_squared = [](const Vec3& a, const Vec3& b) { return dot(a - b, a - b); };
    double farthest = 0, widest = 0;
    for (std::size_t i = 0; i < kLanes; ++i) {
        farthest = std::max(farthest, chord_squared(axis, border[i]));
        widest = std::max(widest, chord_squared(border[i], border[(i + 1) % kLanes]));
    }
    const auto angle = [](double square) { return 2 * std::asin(std::min(0.5 * std::sqrt(square), 1.0)); };
    return {axis, angle(farthest) + kStray * angle(widest)};
}

}  // namespace narpa
