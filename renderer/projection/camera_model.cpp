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

/// From sixteen points of the border. Between two of them the border deviates from the nearer one by half their
/// distance, and a little more where it is curved. The interior lies within, because the projection does not fold
/// where the camera sees.
DirectionCone cone_about_border(const CameraModel& model, const ImageRect& r) noexcept {
    constexpr double kStray = 0.6;
    constexpr std::size_t kPerEdge = kLanes / 4;
    Lanes<double> x, y;
    for (std::size_t i = 0; i < kPerEdge; ++i) {
        const double part = static_cast<double>(i) / kPerEdge;
        const double along_x = part * (r.x_high - r.x_low), along_y = part * (r.y_high - r.y_low);
        x[i] = r.x_low + along_x, y[i] = r.y_low;
        x[kPerEdge + i] = r.x_high, y[kPerEdge + i] = r.y_low + along_y;
        x[2 * kPerEdge + i] = r.x_high - along_x, y[2 * kPerEdge + i] = r.y_high;
        x[3 * kPerEdge + i] = r.x_low, y[3 * kPerEdge + i] = r.y_high - along_y;
    }
    Vec3Lanes border;
    model.directions({}, x, y, border);
    const Vec3 axis = model.direction({0.5 * (r.x_low + r.x_high), 0.5 * (r.y_low + r.y_high)});
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
