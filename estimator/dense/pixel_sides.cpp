#include "estimator/dense/pixel_sides.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace narpa {
namespace {

/// A line across a pixel, from the sample on the nearer surface to that on the opposite border, grid points.
struct Side {
    double x, y, dx, dy;
    double jump;  ///< DN, left or upper minus right or lower sample
    const RaySample *near = nullptr, *far = nullptr;
};

/// The line from a at (x, y) to b; empty if it contributes nothing.
std::optional<Side> side_between(const FineGrid& grid, const RaySample& a, const RaySample& b, double x, double y,
                                 double dx, double dy) {
    const double jump = a.signal - b.signal;
    if (jump == 0) return {};
    const bool near_is_a = a.range_m <= b.range_m;
    const RaySample &near = near_is_a ? a : b, &far = near_is_a ? b : a;
    if (near.body < 0 || near.body == grid.camera.mount) return {};
    return near_is_a ? Side{x, y, dx, dy, jump, &near, &far} : Side{x + dx, y + dy, -dx, -dy, jump, &near, &far};
}

/// Calls act(side) for those lines across the square's pixel that contribute.
template <class Do>
void each_side(const FineGrid& grid, const BorderPoints& points, int column, int row, Do&& act) {
    const int n = grid.fineness, x = (points.square().x + column) * n, y = (points.square().y + row) * n;
    for (int i = 0; i < n; ++i) {
        if (const auto across = side_between(grid, points.left(column, row, i), points.left(column + 1, row, i),
                                             x - 0.5, y + i, n, 0))
            act(*across);
        if (const auto down = side_between(grid, points.upper(column, row, i), points.upper(column, row + 1, i),
                                           x + i, y - 0.5, 0, n))
            act(*down);
    }
}

class PixelBorderFlow {
public:
    /// For the square's pixel (column, row). `contours`, `last`: those on its lines, in order.
    PixelBorderFlow(const FineGrid& grid, const BorderPoints& points, int column, int row, const RowView& view,
                    std::span<const Contour> contours, std::span<const RaySample> last)
        : grid_(grid),
          points_(points),
          column_(column),
          row_(row),
          x_(points.square().x + column),
          y_(points.square().y + row),
          view_(view),
          fine_row_s_(view.row_s / grid.fineness),
          contours_(contours),
          last_(last) {}

    /// Sum over the lines from border to border.
    Vector6 sum() {
        const int n = grid_.fineness;
        std::size_t contour = 0;
        each_side(grid_, points_, column_, row_, [&](const Side& side) {
            if (is_contour(*side.near, *side.far))
                add_contour(side, contours_[contour], last_[contour]), ++contour;
            else
                add(side, edge_between(*side.near, *side.far));
        });
        const double left = x_ * n - 0.5, top = y_ * n - 0.5;
        for (int i = 0; i < n; ++i) {
            add(points_.left_shift(column_, row_, i), 1, left, y_ * n + i, true);
            add(points_.left_shift(column_ + 1, row_, i), -1, left + n, y_ * n + i, true);
            add(points_.upper_shift(column_, row_, i), 1, x_ * n + i, top, false);
            add(points_.upper_shift(column_, row_ + 1, i), -1, x_ * n + i, top + n, false);
        }
        if (fine_row_s_ == 0) add_by_direction();
        return sum_ / (static_cast<double>(n) * n);
    }

private:
    /// Sums over the lines in one direction of the image.
    struct Jumps {
        double sum = 0, over_range = 0;  ///< DN, DN / m
    };

    /// `sign`: 1 on the left and upper border, -1 on the others.
    void add(const BorderShift& shift, double sign, double x, double y, bool horizontal) {
        if (shift.signal == 0) return;
        const Side side{x, y, horizontal ? 1.0 : 0.0, horizontal ? 0.0 : 1.0, sign * shift.signal};
        add(side, {0, shift.range_m});
    }

    /// Adds a line whose change lies at this edge.
    void add(const Side& side, const EdgePlace& edge) {
        if (fine_row_s_ == 0) {
            Jumps& jumps = side.dy == 0 ? across_x_ : across_y_;
            jumps.sum += side.jump;
            jumps.over_range += side.jump / edge.range_m;
        } else {
            sum_ += side.jump * velocity(side.x + edge.along * side.dx, side.y + edge.along * side.dy, edge.range_m,
                                         side.dy == 0);
        }
    }

    /// Changes on the nearer surface before its end move with that surface.
    void add_contour(const Side& side, const Contour& c, const RaySample& last) {
        Side on_surface = side, end = side;
        on_surface.jump = (c.dx + c.dy > 0 ? 1 : -1) * (c.near->signal - last.signal);
        end.jump -= on_surface.jump;
        const EdgePlace edge = edge_between(*c.near, last);
        add(on_surface, {edge.along * c.on_near, edge.range_m});
        add(end, {c.middle(), c.range_m});
    }

    /// If all rows are exposed together, the velocity is linear in the inverse range and otherwise nearly constant
    /// within a pixel: uses the direction of its centre.
    void add_by_direction() {
        const CameraModel& model = *grid_.frame.model;
        const double middle = 0.5 * (grid_.fineness - 1);
        const Vec3 direction = model.direction({x_ * grid_.fineness + middle, y_ * grid_.fineness + middle});
        const ProjectionJacobian J = model.jacobian(direction);
        const auto add_sides = [&](const Jumps& jumps, const Vec3& move) {
            const Vec3 turn =
                jumps.sum * cross(direction, move) - jumps.over_range * cross(view_.t_camera_target, move);
            sum_.head<3>() += to_eigen(turn);
            sum_.tail<3>() += to_eigen(jumps.over_range * move);
        };
        add_sides(across_x_, J.x);
        add_sides(across_y_, J.y);
    }

    /// Image velocity across a side at this point of the grid: grid points per unit of the pose's error.
    [[nodiscard]] Vector6 velocity(double x, double y, double range_m, bool horizontal) const {
        const CameraModel& model = *grid_.frame.model;
        const Vec3 point = range_m * model.direction({x, y});
        const Vec3 a = point - view_.t_camera_target;  // about the target's origin, in camera axes
        const ProjectionJacobian J = model.jacobian(point);
        Vec3 move = horizontal ? J.x : J.y;
        if (fine_row_s_ != 0) {  // a point that moves down is exposed later and moves on meanwhile
            const Vec3 v_m_s = view_.motion.velocity_m_s + cross(view_.motion.rate_rad_s, a);
            const Vec3 down = (1 / (1 - dot(J.y, v_m_s) * fine_row_s_)) * J.y;
            move = horizontal ? J.x + dot(J.x, v_m_s) * fine_row_s_ * down : down;
        }
        Vector6 row;
        row << to_eigen(cross(a, move)), to_eigen(move);
        return row;
    }

    const FineGrid& grid_;
    const BorderPoints& points_;
    const int column_, row_, x_, y_;
    const RowView& view_;
    const double fine_row_s_;
    Vector6 sum_ = Vector6::Zero();
    const std::span<const Contour> contours_;
    const std::span<const RaySample> last_;
    Jumps across_x_, across_y_;
};

}  // namespace

TileBorderFlow::TileBorderFlow(const FineGrid& grid, PointTracer& tracer, const BorderPoints& points, int width,
                               std::span<const std::uint8_t> chosen)
    : grid_(grid), points_(points) {
    const Square& square = points.square();
    for (int r = 0; r < square.rows; ++r)
        for (int c = 0; c < square.columns; ++c) {
            first_.push_back(contours_.size());
            if (chosen[index_in(width, square.x + c, square.y + r)] == 0) continue;
            each_side(grid, points, c, r, [&](const Side& s) {
                if (is_contour(*s.near, *s.far)) contours_.push_back({s.x, s.y, s.dx, s.dy, s.near, s.far});
            });
        }
    first_.push_back(contours_.size());
    bisect(grid.frame, contours_, grid.halvings);
    last_.resize(contours_.size());
    for (std::size_t i = 0; i < contours_.size(); ++i) {
        const Contour& c = contours_[i];
        tracer.put(c.x + c.on_near * c.dx, c.y + c.on_near * c.dy, last_[i]);
    }
    tracer.trace();
}

Vector6 TileBorderFlow::flow_over_borders(int column, int row, const RowView& view) const {
    const std::size_t p = pixel(column, row), first = first_[p], n = first_[p + 1] - first;
    return PixelBorderFlow(grid_, points_, column, row, view, std::span(contours_).subspan(first, n),
                           std::span(last_).subspan(first, n))
        .sum();
}

}  // namespace narpa
