#include "estimator/dense/pixel_sides.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace narpa {
namespace {

/// Neighbouring points of one surface are at most this many times as far apart as its slope predicts.
constexpr double kSurfaceSteps = 2.5;
/// Lower limit of the cosine between ray and normal in that prediction.
constexpr double kLeastCosine = 0.02;
/// Bisections between two rays in the search for a contour.
constexpr int kHalvings = 8;

class PixelSides {
public:
    /// Of the square's pixel (column, row).
    PixelSides(const FineGrid& grid, PointTracer& tracer, const BorderPoints& points, int column, int row,
               const RowView& view)
        : grid_(grid),
          tracer_(tracer),
          points_(points),
          column_(column),
          row_(row),
          x_(points.square().x + column),
          y_(points.square().y + row),
          view_(view),
          fine_row_s_(view.row_s / grid.fineness) {}

    /// Sum over the lines from border to border.
    Vector6 sum() {
        const int n = grid_.fineness;
        const double left = x_ * n - 0.5, top = y_ * n - 0.5;
        for (int i = 0; i < n; ++i) {
            add(points_.left(column_, row_, i), points_.left(column_ + 1, row_, i), left, y_ * n + i, n, 0);
            add(points_.upper(column_, row_, i), points_.upper(column_, row_ + 1, i), x_ * n + i, top, 0, n);
        }
        add_contours();
        if (fine_row_s_ == 0) add_by_direction();
        return sum_ / (static_cast<double>(n) * n);
    }

private:
    /// From the sample on the nearer surface to that on the opposite border, grid points.
    struct Side {
        double x, y, dx, dy;
        double jump;  ///< DN, left or upper minus right or lower sample
    };
    /// Of the sides across one direction of the image.
    struct Jumps {
        double sum = 0, over_range = 0;  ///< DN, DN / m
    };
    struct Contour {
        Side side;
        const RaySample *near, *far;
        double range_m = near->range_m;  ///< of the nearer surface
        double on_near = 0, on_far = 1;
        RaySample last{};  ///< of the nearer surface before its end

        [[nodiscard]] double middle() const { return 0.5 * (on_near + on_far); }
        void halve(int body, double here_m) {
            if (body >= 0 && (body != far->body || std::abs(here_m - range_m) < std::abs(here_m - far->range_m)))
                on_near = middle(), range_m = here_m;
            else
                on_far = middle();
        }
    };

    /// The line from a at (x, y) to b.
    void add(const RaySample& a, const RaySample& b, double x, double y, double dx, double dy) {
        const double jump = a.signal - b.signal;
        if (jump == 0) return;
        const bool near_is_a = a.range_m <= b.range_m;
        const RaySample &near = near_is_a ? a : b, &far = near_is_a ? b : a;
        if (near.body < 0 || near.body == grid_.camera.mount) return;
        const Side side = near_is_a ? Side{x, y, dx, dy, jump} : Side{x + dx, y + dy, -dx, -dy, jump};
        if (is_contour(a, b))
            contours_.push_back({side, &near, &far});
        else
            add(side, 0.5, 2 / (1 / a.range_m + 1 / b.range_m));
    }

    /// `along`: where between the nearer sample, 0, and the other, 1, the edge lies.
    void add(const Side& side, double along, double range_m) {
        if (fine_row_s_ == 0) {
            Jumps& jumps = side.dy == 0 ? across_x_ : across_y_;
            jumps.sum += side.jump;
            jumps.over_range += side.jump / range_m;
        } else {
            sum_ += side.jump * velocity(side.x + along * side.dx, side.y + along * side.dy, range_m, side.dy == 0);
        }
    }

    /// Where rows are exposed together a velocity is linear in the inverse range, and hardly changes in a pixel
    /// otherwise: that of its centre.
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

    /// Bisects contours side by side: where between two samples the nearer surface ends, and its range there.
    void add_contours() {
        const Frame& f = grid_.frame;
        RayBatch rays;
        HitBatch hits;
        for (std::size_t first = 0; first < contours_.size(); first += kLanes) {
            rays.n = std::min(kLanes, contours_.size() - first);
            const std::span<Contour> batch(&contours_[first], rays.n);
            for (int k = 0; k < kHalvings; ++k) {
                for (std::size_t i = 0; i < batch.size(); ++i) {
                    const Contour& c = batch[i];
                    rays.put(i,
                             ray_through(f, c.side.x + c.middle() * c.side.dx, c.side.y + c.middle() * c.side.dy));
                }
                f.tracer.intersect(f.at, rays, f.tracer.all_bodies(), hits);
                for (std::size_t i = 0; i < batch.size(); ++i) batch[i].halve(hits.body[i], hits.range_m[i]);
            }
            for (Contour& c : batch) {
                const double x = c.side.x + c.on_near * c.side.dx, y = c.side.y + c.on_near * c.side.dy;
                tracer_.put(x, y, c.last);
            }
            tracer_.trace();
            for (const Contour& c : batch) {
                // What changes on the surface before its end moves with the surface.
                Side on_surface = c.side;
                on_surface.jump = (c.side.dx + c.side.dy > 0 ? 1 : -1) * (c.near->signal - c.last.signal);
                Side end = c.side;
                end.jump -= on_surface.jump;
                add(on_surface, 0.5 * c.on_near, 2 / (1 / c.near->range_m + 1 / c.range_m));
                add(end, c.middle(), c.range_m);
            }
        }
        contours_.clear();
    }

    /// True where the two are not points of one surface, by the slopes from their normals.
    static bool is_contour(const RaySample& a, const RaySample& b) {
        if (a.body != b.body) return true;
        const double cosine =
            std::max(std::min(std::abs(dot(a.normal, a.ray_direction)), std::abs(dot(b.normal, b.ray_direction))),
                     kLeastCosine);
        const double range_m = kSurfaceSteps * std::max(a.range_m, b.range_m);
        const Vec3 apart = a.position - b.position, turn = a.ray_direction - b.ray_direction;
        return dot(apart, apart) * cosine * cosine > range_m * range_m * dot(turn, turn);
    }

    /// Image velocity across a side at this point of the grid: grid points per unit of the pose's error.
    [[nodiscard]] Vector6 velocity(double x, double y, double range_m, bool horizontal) const {
        const CameraModel& model = *grid_.frame.model;
        const Vec3 point = range_m * model.direction({x, y});
        const Vec3 a = point - view_.t_camera_target;  // about the target's origin, in camera axes
        const ProjectionJacobian J = model.jacobian(point);
        Vec3 move = horizontal ? J.x : J.y;
        if (fine_row_s_ != 0) {  // what moves down is exposed later, and has moved on by then
            const Vec3 v_m_s = view_.motion.velocity_m_s + cross(view_.motion.rate_rad_s, a);
            const Vec3 down = (1 / (1 - dot(J.y, v_m_s) * fine_row_s_)) * J.y;
            move = horizontal ? J.x + dot(J.x, v_m_s) * fine_row_s_ * down : down;
        }
        Vector6 row;
        row << to_eigen(cross(a, move)), to_eigen(move);
        return row;
    }

    const FineGrid& grid_;
    PointTracer& tracer_;
    const BorderPoints& points_;
    const int column_, row_, x_, y_;
    const RowView& view_;
    const double fine_row_s_;
    Vector6 sum_ = Vector6::Zero();
    Jumps across_x_, across_y_;
    std::vector<Contour> contours_;
};

}  // namespace

Vector6 flow_over_borders(const FineGrid& grid, PointTracer& tracer, const BorderPoints& points, int column,
                          int row, const RowView& view) {
    return PixelSides(grid, tracer, points, column, row, view).sum();
}

}  // namespace narpa
