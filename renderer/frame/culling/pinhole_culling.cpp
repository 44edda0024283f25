// Projects boxes and ellipsoids into the image of a pinhole.
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/each_isa.h"
#include "renderer/frame/culling/body_culling.h"

namespace narpa {
namespace {

constexpr double kGuard_px = 1e-3;  ///< above the rounding error of image coordinates

/// The image plane of a pinhole in units of tiles: tile (i, j) spans i to i + 1 and j to j + 1.
struct TileGrid {
    TileRect all;
    double width, height;
    Pinhole image;
    double guard = kGuard_px / kTileSize;
    double lens_radius_m, inverse_focus_per_m;  ///< both 0 without a lens
    double longest;  ///< length of the longest ray, from anywhere on the lens, per metre along the camera's z axis

    TileGrid(const Pinhole& pinhole, const Camera& c, const Lens* lens, const TileRect& whole)
        : all(whole),
          width(static_cast<double>(c.width) / kTileSize),
          height(static_cast<double>(c.height) / kTileSize),
          image(pinhole.with_scale(1.0 / kTileSize, 1.0 / kTileSize).with_origin(-0.5, -0.5)),
          lens_radius_m(lens != nullptr ? 0.5 * lens->aperture_diameter_m : 0),
          inverse_focus_per_m(lens != nullptr ? 1 / lens->focus_distance_m : 0) {
        const double x = std::max(image.cx, width - image.cx) / image.fx,
                     y = std::max(image.cy, height - image.cy) / image.fy;
        longest = std::sqrt(1 + x * x + y * y) + lens_radius_m * inverse_focus_per_m;
    }
};

/// A rectangle of the image, in tiles; initially empty.
struct Extent {
    double x_low = 1e300, x_high = -1e300, y_low = 1e300, y_high = -1e300;

    void add(double x, double y, double reach_x, double reach_y) {
        x_low = std::min(x_low, x - reach_x), x_high = std::max(x_high, x + reach_x);
        y_low = std::min(y_low, y - reach_y), y_high = std::max(y_high, y + reach_y);
    }
    [[nodiscard]] bool within(const TileGrid& g) const {
        return x_high >= -g.guard && x_low <= g.width + g.guard && y_high >= -g.guard &&
               y_low <= g.height + g.guard;
    }
};

int tile_at(double x, int last) {
    return static_cast<int>(std::min(std::max(0.0, x), static_cast<double>(last)));
}

TileRect tiles_of(const Extent& e, const TileGrid& g) {
    return {tile_at(e.x_low - g.guard, g.all.x_last), tile_at(e.y_low - g.guard, g.all.y_last),
            tile_at(e.x_high + g.guard, g.all.x_last), tile_at(e.y_high + g.guard, g.all.y_last)};
}

constexpr std::size_t kCorners = 8;
using PerCorner = std::array<double, kCorners>;
using Corner = std::size_t;  // bit k set: the upper end along axis k
constexpr std::array<PerCorner, 3> kSides{
    {{-1, 1, -1, 1, -1, 1, -1, 1}, {-1, -1, 1, 1, -1, -1, 1, 1}, {-1, -1, -1, -1, 1, 1, 1, 1}}};
struct Edge {
    Corner a, b;
    unsigned faces;  ///< bits of the two adjacent faces: 2 k the lower, 2 k + 1 the upper one along axis k
};
constexpr std::array<Edge, 12> kEdges = [] {
    std::array<Edge, 12> edges{};
    std::size_t n = 0;
    for (unsigned along = 0; along < 3; ++along)
        for (Corner a = 0; a < kCorners; ++a) {
            if ((a >> along & 1u) != 0) continue;
            unsigned faces = 0;
            for (unsigned k = 0; k < 3; ++k)
                if (k != along) faces |= 1u << (2 * k + (a >> k & 1u));
            edges[n++] = {a, a | 1u << along, faces};
        }
    return edges;
}();

/// A box in the camera's frame.
class CameraBox {
public:
    CameraBox(const BoxNode& node, const TileGrid& grid, const BodyView& view, double slack_m)
        : grid_(grid), view_(view), centre_(view.centre_camera) {
        for (std::size_t k = 0; k < 3; ++k) {
            const double low = node.low[k], high = node.high[k];
            half_m_[k] = 0.5 * (high - low) + slack_m;
            from_camera_m_[k] = 0.5 * (low + high) - view.camera_body[static_cast<int>(k)];
            centre_ += 0.5 * (low + high) * view.axes[k];
            half_z_ += std::abs(view.axes[k].z) * half_m_[k];
        }
    }

    [[nodiscard]] bool behind() const { return centre_.z + half_z_ <= 0; }
    [[nodiscard]] bool in_front() const { return centre_.z - half_z_ > 0; }

    /// Image extent of a box in front of the camera: (x + dx) / (z + dz) = x / z + (dx - (x / z) dz) / (z + dz),
    /// and the bracket is linear over the box. Rays from other points of the lens shift it by the blur.
    [[nodiscard]] Extent project() const {
        const double x = centre_.x / centre_.z, y = centre_.y / centre_.z, inverse_z = 1 / (centre_.z - half_z_);
        double reach_x = 0, reach_y = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            reach_x += std::abs(view_.axes[k].x - x * view_.axes[k].z) * half_m_[k];
            reach_y += std::abs(view_.axes[k].y - y * view_.axes[k].z) * half_m_[k];
        }
        Extent e;
        const double blur = widest_blur();
        const auto [image_x, image_y] = grid_.image.of_plane(x, y);
        e.add(image_x, image_y, grid_.image.fx * (reach_x * inverse_z + blur),
              grid_.image.fy * (reach_y * inverse_z + blur));
        return e;
    }

    /// The same for a box that is partly behind the camera; false if it may be anywhere.
    bool project_clipped(Extent& e) const {
        double away2 = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            const double beyond = std::max(0.0, std::abs(from_camera_m_[k]) - half_m_[k]);
            away2 += beyond * beyond;
        }
        // Lower bound of the z coordinate at which a ray of the image meets the box.
        const double near_z = (1 - 1e-9) * (std::sqrt(away2) - grid_.lens_radius_m) / grid_.longest;
        if (!(near_z > 0)) return false;
        const Corners p = corners();
        const auto add = [&](double x, double y, double z) {
            const double blur = grid_.lens_radius_m * std::abs(1 / z - grid_.inverse_focus_per_m);
            const auto [image_x, image_y] = grid_.image.of_plane(x / z, y / z);
            e.add(image_x, image_y, grid_.image.fx * blur, grid_.image.fy * blur);
        };
        for (std::size_t c = 0; c < kCorners; ++c)
            if (p.z[c] >= near_z) add(p.x[c], p.y[c], p.z[c]);
        for (const Edge& edge : kEdges)
            if (const auto [a, b] = std::pair(edge.a, edge.b); (p.z[a] >= near_z) != (p.z[b] >= near_z)) {
                const double part = (near_z - p.z[a]) / (p.z[b] - p.z[a]);
                add(p.x[a] + part * (p.x[b] - p.x[a]), p.y[a] + part * (p.y[b] - p.y[a]), near_z);
            }
        return true;
    }

    /// Calls f(row, x_low, x_high) with the part of each row of tiles that the outline of a box in front covers.
    /// From each point of the lens the box's image is convex.
    template <class F>
    void for_each_row(const TileRect& rect, const F& f) const {
        const double blur = widest_blur();
        const double reach_x = grid_.image.fx * blur + grid_.guard, reach_y = grid_.image.fy * blur + grid_.guard;
        Corners p = corners();
        for (std::size_t c = 0; c < kCorners; ++c) {
            const double inverse_z = 1 / p.z[c];
            const auto [x, y] = grid_.image.of_plane(p.x[c] * inverse_z, p.y[c] * inverse_z);
            p.x[c] = x, p.y[c] = y;
        }
        struct Line {
            double x_upper, y_upper, x_lower, y_lower, slope;
        };
        const Faces seen = faces();
        std::array<Line, kEdges.size()> outline;
        std::size_t n = 0;
        for (const Edge& edge : kEdges) {
            if (!seen.may_be_outline(edge)) continue;
            Line& l = outline[n++] = {p.x[edge.a], p.y[edge.a], p.x[edge.b], p.y[edge.b], 0};
            if (l.y_lower < l.y_upper) std::swap(l.x_upper, l.x_lower), std::swap(l.y_upper, l.y_lower);
            if (l.y_lower > l.y_upper) l.slope = (l.x_lower - l.x_upper) / (l.y_lower - l.y_upper);
        }
        for (int row = rect.y_first; row <= rect.y_last; ++row) {
            const double top = row - reach_y, bottom = row + 1 + reach_y;
            double low = 1e300, high = -1e300;
            for (std::size_t i = 0; i < n; ++i) {
                const Line& l = outline[i];
                if (l.y_lower < top || l.y_upper > bottom) continue;
                const double enters = l.y_upper < top ? l.x_upper + l.slope * (top - l.y_upper) : l.x_upper;
                const double leaves = l.y_lower > bottom ? l.x_upper + l.slope * (bottom - l.y_upper) : l.x_lower;
                low = std::min({low, enters, leaves}), high = std::max({high, enters, leaves});
            }
            if (high >= low) f(row, low - reach_x, high + reach_x);
        }
    }

private:
    /// Faces that may be visible, and faces that may be hidden, from some point of the lens: bit 2 k the lower, 2 k
    /// + 1 the upper one along axis k.
    struct Faces {
        unsigned may_show = 0, may_hide = 0;

        /// False for an edge between two faces that are both visible, or both hidden, from the whole lens.
        [[nodiscard]] bool may_be_outline(const Edge& edge) const {
            return (may_show & edge.faces) != 0 && (may_hide & edge.faces) != 0;
        }
    };
    [[nodiscard]] Faces faces() const {
        Faces f;
        for (std::size_t k = 0; k < 3; ++k) {
            const double doubt = grid_.lens_radius_m + 1e-9 * (half_m_[k] + std::abs(from_camera_m_[k]));
            const double above_low = from_camera_m_[k] - half_m_[k], above_high = -from_camera_m_[k] - half_m_[k];
            f.may_show |= (above_low > -doubt ? 1u : 0u) << 2 * k | (above_high > -doubt ? 2u : 0u) << 2 * k;
            f.may_hide |= (above_low < doubt ? 1u : 0u) << 2 * k | (above_high < doubt ? 2u : 0u) << 2 * k;
        }
        return f;
    }

    /// The largest blur radius over the box, on the plane z = 1.
    [[nodiscard]] double widest_blur() const {
        if (grid_.lens_radius_m == 0) return 0;
        return grid_.lens_radius_m * std::max(std::abs(1 / (centre_.z - half_z_) - grid_.inverse_focus_per_m),
                                              std::abs(1 / (centre_.z + half_z_) - grid_.inverse_focus_per_m));
    }

    struct Corners {
        PerCorner x, y, z;  ///< camera's frame, metres
    };
    [[nodiscard]] Corners corners() const {
        const Vec3 i = half_m_[0] * view_.axes[0], j = half_m_[1] * view_.axes[1], k = half_m_[2] * view_.axes[2];
        Corners p;
        for (std::size_t c = 0; c < kCorners; ++c) {
            p.x[c] = centre_.x + kSides[0][c] * i.x + kSides[1][c] * j.x + kSides[2][c] * k.x;
            p.y[c] = centre_.y + kSides[0][c] * i.y + kSides[1][c] * j.y + kSides[2][c] * k.y;
            p.z[c] = centre_.z + kSides[0][c] * i.z + kSides[1][c] * j.z + kSides[2][c] * k.z;
        }
        return p;
    }

    const TileGrid& grid_;
    const BodyView& view_;
    Vec3 centre_;                                   ///< camera's frame
    double half_z_ = 0;                             ///< half of its extent along the camera's z axis
    std::array<double, 3> from_camera_m_, half_m_;  ///< body frame
};

/// Marks the boxes of a tree, descending only as far as is needed to tell tiles apart.
NARPA_EACH_ISA void mark_boxes(std::span<const BoxNode> nodes, const TileGrid& grid, const BodyView& view,
                               double slack_m, TileMask& mask) {
    std::array<std::uint32_t, kBoxLeaves + 1> open;  // a stack; grows by one per level
    std::size_t n = 0;
    open[n++] = 0;
    while (n > 0) {
        const BoxNode& node = nodes[open[--n]];
        const CameraBox box(node, grid, view, slack_m);
        if (box.behind()) continue;
        const bool leaf = node.children == 0;
        const auto descend = [&] { open[n++] = node.children, open[n++] = node.children + 1; };
        if (!box.in_front()) {
            Extent e;
            if (!leaf)
                descend();
            else if (!box.project_clipped(e))
                return mask.mark(grid.all);
            else if (e.within(grid))
                mask.mark(tiles_of(e, grid));
            continue;
        }
        const Extent e = box.project();
        if (!e.within(grid)) continue;
        const TileRect rect = tiles_of(e, grid);
        if (mask.all_marked(rect)) continue;
        const int columns = rect.x_last - rect.x_first + 1, rows = rect.y_last - rect.y_first + 1;
        if (columns * rows <= 2)
            mask.mark(rect);
        else if (!leaf && columns * rows > 9)
            descend();
        else if (columns == 1 || rows == 1)
            mask.mark(rect);
        else
            box.for_each_row(rect, [&](int row, double low, double high) {
                if (high >= 0 && low <= grid.width)
                    mask.mark({tile_at(low, grid.all.x_last), row, tile_at(high, grid.all.x_last), row});
            });
    }
}

/// Exact test of an ellipsoid in front of the camera, around it or partly behind it: in the frame scaled so that
/// the ellipsoid is a sphere, the rays that meet it form a circular cone, and those of an image rectangle are
/// bounded by another.
class CameraEllipsoid {
public:
    CameraEllipsoid(const BodyBounds& bounds, const TileGrid& grid, const BodyView& view, double slack_m) {
        const Vec3& semi_axes_m = bounds.semi_axes_m;
        // The lens is allowed for by adding a ball of the lens's radius: an ellipsoid that contains the sum (A.
        // Kurzhanski, I. Valyi, "Ellipsoidal Calculus for Estimation and Control", 1997, the one of least trace;
        // for a sphere it is the sum itself).
        const double ball = grid.lens_radius_m + slack_m, p = norm(semi_axes_m) / (std::sqrt(3.0) * ball);
        Vec3 axes;
        for (int k = 0; k < 3; ++k)
            axes[k] = (1 + 1e-9) * std::sqrt((1 + 1 / p) * semi_axes_m[k] * semi_axes_m[k] + (1 + p) * ball * ball);
        const double radius = std::max({axes.x, axes.y, axes.z});
        const Vec3 squeeze{radius / axes.x, radius / axes.y, radius / axes.z};
        to_centre_ = (bounds.centre_m - view.camera_body) * squeeze;
        const double distance = norm(to_centre_);
        around_ = !(distance > radius);
        if (around_) return;
        to_centre_ = to_centre_ / distance;
        sin_ = radius / distance, cos_ = std::sqrt((1 - sin_) * (1 + sin_));
        const auto [origin, per_x, per_y] = grid.image.rays({});
        const auto squeezed = [&](const Vec3& d) {
            return squeeze * (d.x * view.axes_body[0] + d.y * view.axes_body[1] + d.z * view.axes_body[2]);
        };
        origin_ = squeezed(origin), per_x_ = squeezed(per_x), per_y_ = squeezed(per_y);
        // Largest deflection of a ray by the lens, in tiles.
        reach_x_ = grid.image.fx * grid.lens_radius_m * grid.inverse_focus_per_m + grid.guard;
        reach_y_ = grid.image.fy * grid.lens_radius_m * grid.inverse_focus_per_m + grid.guard;
    }

    void mark(const TileRect& rect, TileMask& mask) const {
        const Overlap overlap = around_ ? Overlap::whole : overlap_with(rect);
        if (overlap == Overlap::none) return;
        const int columns = rect.x_last - rect.x_first + 1, rows = rect.y_last - rect.y_first + 1;
        if (overlap == Overlap::whole || columns * rows == 1) return mask.mark(rect);
        const auto [low, high] = halves(rect);
        mark(low, mask);
        mark(high, mask);
    }

private:
    enum class Overlap { none, partly, whole };
    [[nodiscard]] Overlap overlap_with(const TileRect& rect) const {
        const double half_x = 0.5 * (rect.x_last + 1 - rect.x_first) + reach_x_,
                     half_y = 0.5 * (rect.y_last + 1 - rect.y_first) + reach_y_;
        const double x = 0.5 * (rect.x_first + rect.x_last + 1), y = 0.5 * (rect.y_first + rect.y_last + 1);
        const Vec3 middle = normalized(origin_ + x * per_x_ + y * per_y_);
        // Sine of the half angle of the rectangle's bounding cone, from its widest corner.
        double sine = 0;
        for (const double i : {-1.0, 1.0})
            for (const double j : {-1.0, 1.0}) {
                const Vec3 corner = origin_ + (x + i * half_x) * per_x_ + (y + j * half_y) * per_y_;
                if (!(dot(middle, corner) > 0)) return Overlap::partly;
                sine = std::max(sine, norm(cross(middle, corner)) / norm(corner));
            }
        const double cosine = std::sqrt((1 - std::min(1.0, sine)) * (1 + sine));
        const double off_sine = norm(cross(middle, to_centre_)), off_cosine = dot(middle, to_centre_);
        const double sum_sine = sin_ * cosine + cos_ * sine, sum_cosine = cos_ * cosine - sin_ * sine;
        if (off_sine * sum_cosine - off_cosine * sum_sine > 0) return Overlap::none;
        const double rest_sine = sin_ * cosine - cos_ * sine, rest_cosine = cos_ * cosine + sin_ * sine;
        if (rest_sine > 0 && off_sine * rest_cosine - off_cosine * rest_sine < 0) return Overlap::whole;
        return Overlap::partly;
    }

    bool around_ = false;          ///< the camera is inside
    Vec3 to_centre_;               ///< unit
    double sin_ = 0, cos_ = 0;     ///< of the half angle of the body's cone
    Vec3 origin_, per_x_, per_y_;  ///< ray direction as from Pinhole::rays, in the scaled frame
    double reach_x_ = 0, reach_y_ = 0;
};

/// Restricted to the ellipsoid's bounding box, which is the tighter bound for very flat or long ellipsoids.
void mark_ellipsoid(const BodyBounds& bounds, const TileGrid& grid, const BodyView& view, double slack_m,
                    TileMask& mask) {
    const BoxNode node = box_about(bounds);
    const double rounding_m = 0x1p-23 * (norm(bounds.centre_m) + norm(bounds.semi_axes_m));
    const CameraBox box(node, grid, view, rounding_m + slack_m);
    if (box.behind()) return;
    TileRect rect = grid.all;
    if (box.in_front()) {
        const Extent e = box.project();
        if (!e.within(grid)) return;
        rect = tiles_of(e, grid);
    }
    CameraEllipsoid(bounds, grid, view, slack_m).mark(rect, mask);
}

}  // namespace

BoxNode box_about(const BodyBounds& bounds) noexcept {
    const Vec3f low = vec_cast<float>(bounds.centre_m - bounds.semi_axes_m),
                high = vec_cast<float>(bounds.centre_m + bounds.semi_axes_m);
    return {{low.x, low.y, low.z}, {high.x, high.y, high.z}};
}

void mark_by_projection(const Pinhole& pinhole, const Camera& camera, const Lens* lens, const CulledBody& body,
                        TileMask& mask) noexcept {
    const TileGrid grid(pinhole, camera, lens, mask.all());
    if (body.boxes.empty())
        mark_ellipsoid(body.bounds, grid, body.view, body.slack_m, mask);
    else
        mark_boxes(body.boxes, grid, body.view, body.slack_m, mask);
}

}  // namespace narpa
