/// estimator/dense/surface_edges.h - finds edges on a line across the image.
#pragma once

#include <span>

#include "renderer/frame/camera_rays.h"

namespace narpa {

/// The first hit of one ray. No hit: body -1, infinite range.
struct RaySample {
    double signal = 0;  ///< DN above black
    int body = -1;
    double range_m = 0;                          ///< along the ray
    Vec3 position{}, normal{}, ray_direction{};  ///< world
};

/// Ray through a point of the image, in the middle of its row's exposure.
[[nodiscard]] Ray ray_through(const Frame& f, double x, double y);

/// Rays through `rays.n` points.
void aim_through(const Frame& f, const Lanes<double>& x, const Lanes<double>& y, RayBatch& rays);

/// True if the two are not points of one surface, by the slopes from their normals.
[[nodiscard]] bool is_contour(const RaySample& a, const RaySample& b);

/// Position of an edge on the line between two points, 0 to 1, and its range.
struct EdgePlace {
    double along, range_m;
};

/// Edge between two points of one surface: the crease where their tangent planes meet, if that is between them;
/// else the midpoint, which is right on average. Along a line of sight the creases of a face seen edge-on may be as
/// far apart as the face is long.
[[nodiscard]] EdgePlace edge_between(const RaySample& a, const RaySample& b);

/// The end of a surface in front of another, or of nothing, on a line between two points of the image.
struct Contour {
    double x, y, dx, dy;  ///< from the nearer sample to the other
    const RaySample *near, *far;
    double range_m = near->range_m;  ///< of the nearer surface before its end
    double on_near = 0, on_far = 1;  ///< the end is between them
    [[nodiscard]] double middle() const { return 0.5 * (on_near + on_far); }
};
/// Locates the contours by this many bisections, in batches.
void bisect(const Frame& f, std::span<Contour> contours, int halvings);

}  // namespace narpa
