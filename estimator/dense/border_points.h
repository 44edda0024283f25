/// estimator/dense/border_points.h - rays through the borders of an image's pixels, for its derivative.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/view/measured_image.h"
#include "renderer/film/camera_batch.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// Row-major.
inline std::size_t index_in(int width, int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

/// Through a point of the image, in the middle of its row's exposure.
[[nodiscard]] Ray ray_through(const Frame& f, double x, double y);

/// A camera with fineness x fineness pixels for each pixel of another.
struct FineGrid {
    /// `path`: while the fine grid's rows are exposed. `render_scene` and `at` outlive it.
    FineGrid(const RenderScene& render_scene, const BodyPoses& at, const Camera& pixels, const CameraPose& path,
             const FrameSettings& for_all, int factor);
    FineGrid(const FineGrid&) = delete;
    FineGrid& operator=(const FineGrid&) = delete;

    const int fineness;
    const Camera camera;
    const FrameSettings settings;
    const Frame frame;
};

/// The first hit of one ray. None: body -1, infinite range.
struct RaySample {
    double signal = 0;  ///< DN above black
    int body = -1;
    double range_m = 0;                          ///< along the ray
    Vec3 position{}, normal{}, ray_direction{};  ///< world
};

/// Traces rays through any points of a grid, to the centre of the Sun from there.
class PointTracer {
public:
    PointTracer(const FineGrid& grid, const SensorModel& sensor);
    /// `seen` is written by the next `trace`, if not before.
    void put(double x, double y, RaySample& seen);
    void trace();

private:
    const FineGrid& grid_;
    const Frame& f_;
    const SensorModel& sensor_;
    CameraBatch p_;
    std::size_t n_ = 0;
    Lanes<double> x_{}, y_{};
    Lanes<RaySample*> seen_{};
};

/// Pixels of the image that are traced together.
struct Square {
    int x, y, columns, rows;
};

/// Points on the borders of a square's chosen pixels, as many on each as the grid has in a pixel's side.
class BorderPoints {
public:
    BorderPoints(int fineness, const Square& square)
        : n_(fineness), square_(square), left_(index(0, square.rows, 0)), upper_(index(0, square.rows + 1, 0)) {}

    [[nodiscard]] const Square& square() const noexcept { return square_; }

    /// `chosen`: not 0 for those pixels of the image, which is `width` pixels wide.
    void trace(PointTracer& tracer, int width, std::span<const std::uint8_t> chosen);
    /// Point i on the left border of the square's pixel (c, r), from above.
    [[nodiscard]] const RaySample& left(int c, int r, int i) const { return left_[index(c, r, i)]; }
    /// Point i on its upper border, from the left.
    [[nodiscard]] const RaySample& upper(int c, int r, int i) const { return upper_[index(c, r, i)]; }

private:
    [[nodiscard]] std::size_t index(int c, int r, int i) const {
        return index_in(square_.columns + 1, c, r) * static_cast<std::size_t>(n_) + static_cast<std::size_t>(i);
    }

    const int n_;
    const Square square_;
    std::vector<RaySample> left_, upper_;
};

}  // namespace narpa
