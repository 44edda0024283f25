/// estimator/dense/border_points.h - rays through the borders of an image's pixels, for its derivative.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/dense/surface_edges.h"
#include "estimator/view/measured_image.h"
#include "renderer/frame/camera_image.h"
#include "renderer/frame/camera_rays.h"

namespace narpa {

/// Index in a row-major array.
inline std::size_t index_in(int width, int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

/// A camera with fineness x fineness pixels for each pixel of another.
struct FineGrid {
    /// `path`: camera path for the fine grid's rows. `render_scene` and `at` outlive it.
    FineGrid(const RenderScene& render_scene, const BodyPoses& at, const Camera& pixels, const CameraPose& path,
             const FrameSettings& for_all, int factor);
    FineGrid(const FineGrid&) = delete;
    FineGrid& operator=(const FineGrid&) = delete;

    const int fineness;
    /// Bisection steps of the search for a contour. The range of a smooth body's limb needs eight; if few lines
    /// make the derivative coarse, fewer lead to the same steps of the pose and the same choice of pixels.
    const int halvings = std::min(2 * fineness, 8);
    const Camera camera;
    const FrameSettings settings;
    const Frame frame;
};

/// Traces rays through arbitrary points of a grid; lit by the centre of the Sun.
class PointTracer {
public:
    PointTracer(const FineGrid& grid, const SensorModel& sensor);
    /// `seen` is written by the next `trace` at the latest.
    void put(double x, double y, RaySample& seen);
    void trace();

private:
    const FineGrid& grid_;
    const Frame& f_;
    const SensorModel& sensor_;
    TracedRays p_;
    std::size_t n_ = 0;
    Lanes<double> x_{}, y_{};
    Lanes<RaySample*> seen_{};
};

/// A block of pixels of the image that are traced together.
struct Square {
    int x, y, columns, rows;
};

/// A point represents a stretch of the border as long as the spacing of the points. If a contour or a crease
/// crosses that, the mean over the stretch differs from the point's value.
struct BorderShift {
    double signal = 0;   ///< the mean less the point's, DN
    double range_m = 0;  ///< of the edge; if two, of the one with the larger change
};

/// Points on the borders of a square's chosen pixels, `fineness` on each side of a pixel.
class BorderPoints {
public:
    BorderPoints(int fineness, const Square& square)
        : n_(fineness),
          square_(square),
          left_(square.columns + 1, square.rows * fineness),
          upper_(square.rows + 1, square.columns * fineness) {}

    [[nodiscard]] const Square& square() const noexcept { return square_; }

    /// `chosen`: not 0 for those pixels of the image, which is `width` pixels wide.
    void trace(const FineGrid& grid, PointTracer& tracer, int width, std::span<const std::uint8_t> chosen);
    /// Point i on the left border of the square's pixel (c, r), from above.
    [[nodiscard]] const RaySample& left(int c, int r, int i) const { return left_.at(c, r * n_ + i); }
    [[nodiscard]] const BorderShift& left_shift(int c, int r, int i) const { return left_.shift(c, r * n_ + i); }
    /// Point i on the upper border of the pixel, from the left.
    [[nodiscard]] const RaySample& upper(int c, int r, int i) const { return upper_.at(r, c * n_ + i); }
    [[nodiscard]] const BorderShift& upper_shift(int c, int r, int i) const { return upper_.shift(r, c * n_ + i); }

private:
    /// Lines of points along the square, with one more point at either end: -1 to `n`.
    struct Lines {
        Lines(int lines, int count)
            : n(count), points(static_cast<std::size_t>(lines * (count + 2))), shifts(points.size()) {}
        [[nodiscard]] std::size_t index(int line, int k) const { return index_in(n + 2, k + 1, line); }
        [[nodiscard]] RaySample& at(int line, int k) { return points[index(line, k)]; }
        [[nodiscard]] const RaySample& at(int line, int k) const { return points[index(line, k)]; }
        [[nodiscard]] const BorderShift& shift(int line, int k) const { return shifts[index(line, k)]; }

        const int n;
        std::vector<RaySample> points;
        std::vector<BorderShift> shifts;
    };
    /// The first of two neighbouring points of a line that differ.
    struct Step {
        Lines* lines;
        std::size_t first;
    };
    void find_shifts(const FineGrid& grid);
    void add_shift(const Step& step, const EdgePlace& edge);

    const int n_;
    const Square square_;
    Lines left_, upper_;
};

}  // namespace narpa
