#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "renderer/frame/culling/body_culling.h"

namespace narpa {
namespace {

constexpr double kNotComputed = -1;
constexpr double kConeGuard_px = 1e-3;  ///< above the rounding error of image coordinates

double angle_between_directions(const Vec3& a, const Vec3& b) {
    return std::atan2(norm(cross(a, b)), dot(a, b));
}

/// Bounding cone of a part of a body, as the camera sees it.
struct Ball {
    Vec3 direction{0, 0, 1};                   ///< to its centre, unit, camera axes
    double half_angle_rad = std::numbers::pi;  ///< pi: the camera is inside
};

struct ConeCulling {
    TileCones& cones;
    std::span<const BoxNode> nodes;
    const BodyView& view;
    double reach_m;   ///< slack plus the lens's radius, because the origins of rays differ
    double turn_rad;  ///< largest deflection of a ray by the lens
    TileMask& mask;

    /// `number`: the rectangle's, in `cones`.
    void mark(std::uint32_t node, const TileRect& rect, std::size_t number) const {
        if (mask.all_marked(rect)) return;
        const DirectionCone& rays = cones.at(number, rect);
        const double rays_half_angle_rad = rays.half_angle_rad + turn_rad;
        const Ball part = ball(nodes[node]);
        if (angle_between_directions(rays.axis, part.direction) > rays_half_angle_rad + part.half_angle_rad) return;
        const bool one_tile = rect.x_first == rect.x_last && rect.y_first == rect.y_last;
        const std::uint32_t children = nodes[node].children;
        if (one_tile && children == 0) return mask.mark(rect);
        if (one_tile || (children != 0 && part.half_angle_rad > rays_half_angle_rad)) {
            mark(children, rect, number);
            mark(children + 1, rect, number);
            return;
        }
        const auto [low, high] = halves(rect);
        mark(node, low, 2 * number + 1);
        mark(node, high, 2 * number + 2);
    }

    [[nodiscard]] Ball ball(const BoxNode& node) const {
        Vec3 half, from_camera;  // body axes
        for (int k = 0; k < 3; ++k) {
            const auto i = static_cast<std::size_t>(k);
            const double low = node.low[i], high = node.high[i];
            half[k] = 0.5 * (high - low);
            from_camera[k] = 0.5 * (low + high) - view.camera_body[k];
        }
        const double radius_m = norm(half) + reach_m, distance_m = norm(from_camera);
        if (!(distance_m > radius_m)) return {};
        const Vec3 d = from_camera / distance_m;
        return {d.x * view.axes[0] + d.y * view.axes[1] + d.z * view.axes[2], std::asin(radius_m / distance_m)};
    }
};

}  // namespace

TileCones::TileCones(const CameraModel& model, const TileRect& image) : model_(model) {
    const auto depth = [](int tiles) { return std::bit_width(static_cast<unsigned>(tiles - 1)); };
    const int halvings = depth(image.x_last - image.x_first + 1) + depth(image.y_last - image.y_first + 1);
    cones_.assign((std::size_t{2} << halvings) - 1, {{}, kNotComputed});
}

const DirectionCone& TileCones::at(std::size_t number, const TileRect& rect) noexcept {
    DirectionCone& cone = cones_[number];
    if (cone.half_angle_rad != kNotComputed) return cone;
    const auto edge = [](int tile) { return static_cast<double>(tile * kTileSize) - 0.5; };
    return cone = model_.bounds({edge(rect.x_first) - kConeGuard_px, edge(rect.y_first) - kConeGuard_px,
                                 edge(rect.x_last + 1) + kConeGuard_px, edge(rect.y_last + 1) + kConeGuard_px});
}

void mark_by_cones(TileCones& cones, const Lens* lens, const CulledBody& body, TileMask& mask) noexcept {
    const double lens_radius_m = lens != nullptr ? 0.5 * lens->aperture_diameter_m : 0;
    // Largest for a ray from the edge of the aperture to a point at the focus distance.
    const double turn_rad = lens != nullptr ? std::asin(std::min(1.0, lens_radius_m / lens->focus_distance_m)) : 0;
    const BoxNode all = box_about(body.bounds);
    ConeCulling{cones,     body.boxes.empty() ? std::span(&all, 1) : body.boxes,
                body.view, body.slack_m + lens_radius_m,
                turn_rad,  mask}
        .mark(0, mask.all(), 0);
}

}  // namespace narpa
