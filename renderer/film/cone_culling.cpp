#include "renderer/film/cone_culling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "renderer/film/tile_culling.h"

namespace narpa {
namespace {

constexpr double kGuard_px = 1e-3;  ///< more than what rounding does to image coordinates

double angle_between_directions(const Vec3& a, const Vec3& b) {
    return std::atan2(norm(cross(a, b)), dot(a, b));
}

}  // namespace

struct ConeCulling::Body {
    std::span<const BoxNode> nodes;
    const BodyView& view;
    double slack_m;
};

/// As the camera sees it.
struct ConeCulling::Ball {
    Vec3 direction{0, 0, 1};                   ///< to its centre, unit, camera axes
    double half_angle_rad = std::numbers::pi;  ///< pi: the camera is inside
};

ConeCulling::ConeCulling(const CameraModel& model, const Lens* lens, int tiles_x, int tiles_y) noexcept
    : model_(model), tiles_x_(tiles_x), tiles_y_(tiles_y) {
    if (lens == nullptr) return;
    lens_radius_m_ = 0.5 * lens->aperture_diameter_m;
    // From a point of the aperture to one that is no nearer to its centre than the focus distance.
    turn_rad_ = std::asin(std::min(1.0, lens_radius_m_ / lens->focus_distance_m));
}

void ConeCulling::mark(std::span<const BoxNode> nodes, const BodyView& view, double slack_m,
                       TileMask& mask) const noexcept {
    if (!nodes.empty()) mark({nodes, view, slack_m}, 0, {0, 0, tiles_x_ - 1, tiles_y_ - 1}, mask);
}

void ConeCulling::mark(const Body& body, std::uint32_t node, const TileRect& rect, TileMask& mask) const noexcept {
    if (mask.all_marked(rect)) return;
    const DirectionCone rays = cone(rect);
    const Ball part = ball(body, body.nodes[node]);
    if (angle_between_directions(rays.axis, part.direction) > rays.half_angle_rad + part.half_angle_rad) return;
    const int columns = rect.x_last - rect.x_first + 1, rows = rect.y_last - rect.y_first + 1;
    const std::uint32_t children = body.nodes[node].children;
    if (columns * rows == 1 && children == 0) return mask.mark(rect);
    if (columns * rows == 1 || (children != 0 && part.half_angle_rad > rays.half_angle_rad)) {
        mark(body, children, rect, mask);
        mark(body, children + 1, rect, mask);
        return;
    }
    const auto [low, high] = halves(rect);
    mark(body, node, low, mask);
    mark(body, node, high, mask);
}

ConeCulling::Ball ConeCulling::ball(const Body& body, const BoxNode& node) const noexcept {
    Vec3 half, from_camera;  // body axes
    for (int k = 0; k < 3; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const double low = node.low[i], high = node.high[i];
        half[k] = 0.5 * (high - low);
        from_camera[k] = 0.5 * (low + high) - body.view.camera_body[k];
    }
    const double radius_m = norm(half) + body.slack_m + lens_radius_m_, distance_m = norm(from_camera);
    if (!(distance_m > radius_m)) return {};
    const Vec3 d = from_camera / distance_m;
    const auto& axes = body.view.axes;
    return {d.x * axes[0] + d.y * axes[1] + d.z * axes[2], std::asin(radius_m / distance_m)};
}

DirectionCone ConeCulling::cone(const TileRect& rect) const noexcept {
    const auto edge = [](int tile) { return static_cast<double>(tile * kTileSize) - 0.5; };
    DirectionCone rays = model_.bounds({edge(rect.x_first) - kGuard_px, edge(rect.y_first) - kGuard_px,
                                        edge(rect.x_last + 1) + kGuard_px, edge(rect.y_last + 1) + kGuard_px});
    rays.half_angle_rad += turn_rad_;
    return rays;
}

}  // namespace narpa
