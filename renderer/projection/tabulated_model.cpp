#include "renderer/projection/tabulated_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/each_isa.h"
#include "renderer/projection/projection_kind.h"

namespace narpa {
namespace {

constexpr std::size_t kDegree = 3, kTerms = (kDegree + 1) * (kDegree + 1);
constexpr std::array kCellSides{64, 32, 16, 8};  ///< px
/// Points so far outside the image still belong to the cells of its border, px: of tiles that are culled.
constexpr double kOutside_px = 1;
/// Share of the cells that may be left to the model in a table of large cells.
constexpr double kPartOfModel = 0.1;

/// Coefficients of the direction's components by powers of x and y, each in -1 .. 1 over the cell: that of
/// x^i y^j is at 4 j + i.
struct Cell {
    std::array<std::array<double, kTerms>, 3> terms;
    bool is_tabulated;
};

/// Places on -1 .. 1 of Chebyshev's nodes, for cubics.
const std::array<double, 2> kNodes{std::cos(std::numbers::pi / 8), std::cos(3 * std::numbers::pi / 8)};

/// Coefficients of the cubic through the values at -kNodes[0], -kNodes[1], kNodes[1], kNodes[0], `stride` apart.
void to_powers(double* values, std::size_t stride) {
    const double a = kNodes[0], b = kNodes[1], below = 1 / (a * a - b * b);
    double &v0 = values[0], &v1 = values[stride], &v2 = values[2 * stride], &v3 = values[3 * stride];
    const double even_a = 0.5 * (v3 + v0), even_b = 0.5 * (v2 + v1), odd_a = 0.5 * (v3 - v0) / a,
                 odd_b = 0.5 * (v2 - v1) / b;
    const double c2 = (even_a - even_b) * below, c3 = (odd_a - odd_b) * below;
    v0 = even_a - c2 * a * a, v1 = odd_a - c3 * a * a, v2 = c2, v3 = c3;
}

inline double value_at(const std::array<double, kTerms>& c, double x, double y) noexcept {
    double out = 0;
    for (std::size_t j = kDegree + 1; j-- > 0;)
        out = out * y + (((c[4 * j + 3] * x + c[4 * j + 2]) * x + c[4 * j + 1]) * x + c[4 * j]);
    return out;
}
inline Vec3 direction_at(const Cell& cell, double x, double y) noexcept {
    return normalized(
        Vec3{value_at(cell.terms[0], x, y), value_at(cell.terms[1], x, y), value_at(cell.terms[2], x, y)});
}

/// Cells of one size over an image, the first at its corner.
struct CellGrid {
    double side_px = 0;
    int across = 0, down = 0;

    /// Places in a cell are -1 .. 1. A cell at the border has points kOutside_px beyond it, too.
    struct CellBounds {
        double column, row, x_low, x_high, y_low, y_high;

        [[nodiscard]] bool contains(double x, double y) const noexcept {
            return x >= x_low && x < x_high && y >= y_low && y < y_high;
        }
    };
    /// The nearest cell. A number that is no point of an image is nearest to the first.
    [[nodiscard]] CellBounds cell_at(double x, double y) const noexcept {
        const double column = nearest(x, across), row = nearest(y, down), most = 1 + 2 * kOutside_px / side_px;
        return {column,
                row,
                column > 0 ? -1 : -most,
                column < across - 1 ? 1 : most,
                row > 0 ? -1 : -most,
                row < down - 1 ? 1 : most};
    }
    [[nodiscard]] std::size_t number(const CellBounds& cell) const noexcept {
        return static_cast<std::size_t>(cell.row * across + cell.column);
    }
    [[nodiscard]] double within(double x, double column) const noexcept {
        return (x + 0.5 - column * side_px) * (2 / side_px) - 1;
    }

private:
    [[nodiscard]] double nearest(double x, int cells) const noexcept {
        const double place = std::floor((x + 0.5) / side_px), last = cells - 1;
        return place > 0 ? (place < last ? place : last) : 0;
    }
};

/// Directions of all samples, which are in one cell.
NARPA_EACH_ISA void directions_in(const Cell& cell, const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                                  Vec3Lanes& out) noexcept {
    Vec3Lanes direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 d = q * direction_at(cell, x[i], y[i]);
        direction.x[i] = d.x, direction.y[i] = d.y, direction.z[i] = d.z;
    }
    out = direction;
}

/// Places of all samples in a cell. True if they are in it.
NARPA_EACH_ISA bool are_in(const CellGrid& grid, const CellGrid::CellBounds& cell, const Lanes<double>& x,
                           const Lanes<double>& y, Lanes<double>& in_x, Lanes<double>& in_y) noexcept {
    Lanes<double> to_x, to_y;
    int out = 0;
    for (std::size_t i = 0; i < kLanes; ++i) {
        to_x[i] = grid.within(x[i], cell.column), to_y[i] = grid.within(y[i], cell.row);
        out |= static_cast<int>(!cell.contains(to_x[i], to_y[i]));
    }
    in_x = to_x, in_y = to_y;
    return out == 0;
}

class TabulatedModel final : public CameraModel {
public:
    TabulatedModel(std::shared_ptr<const CameraModel> model, int width, int height) : model_(std::move(model)) {
        for (const int side : kCellSides) {
            make_cells(side, width, height);
            const auto of_model = std::ranges::count(cells_, false, &Cell::is_tabulated);
            if (static_cast<double>(of_model) <= kPartOfModel * static_cast<double>(cells_.size())) return;
        }
    }

    [[nodiscard]] Vec3 direction(const ImagePoint& p) const noexcept override { return model_->direction(p); }
    [[nodiscard]] Vec3 on_plane(const ImagePoint& p) const noexcept override { return model_->on_plane(p); }
    void directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                    Vec3Lanes& out) const noexcept override {
        const CellGrid::CellBounds first = grid_.cell_at(x[0], y[0]);
        const Cell& cell = cells_[grid_.number(first)];
        Lanes<double> in_x, in_y;
        if (are_in(grid_, first, x, y, in_x, in_y) && cell.is_tabulated)
            directions_in(cell, q, in_x, in_y, out);
        else
            for (std::size_t i = 0; i < kLanes; ++i) out.put(i, q * one_direction({x[i], y[i]}));
    }
    [[nodiscard]] DirectionCone bounds(const ImageRect& rect) const noexcept override {
        const RectBorder points = border_of(rect);
        const ImagePoint p = middle(rect);
        // By the cell of the middle also if the rectangle touches the next one.
        CellGrid::CellBounds near = grid_.cell_at(p.x, p.y);
        const Cell& cell = cells_[grid_.number(near)];
        const double most = 1 + 2 * kOutside_px / grid_.side_px;
        near.x_low = near.y_low = -most, near.x_high = near.y_high = most;
        Lanes<double> x, y;
        Vec3Lanes border;
        if (are_in(grid_, near, points.x, points.y, x, y) && cell.is_tabulated)
            directions_in(cell, {}, x, y, border);
        else
            directions({}, points.x, points.y, border);
        return cone_about_border(one_direction(p), border);
    }

    [[nodiscard]] std::optional<ImagePoint> project(const Vec3& p) const noexcept override {
        return model_->project(p);
    }
    [[nodiscard]] ProjectionJacobian jacobian(const Vec3& p) const noexcept override { return model_->jacobian(p); }
    [[nodiscard]] bool sees(const ImagePoint& p) const noexcept override { return model_->sees(p); }
    [[nodiscard]] double pixels_per_sr(const Vec3& d) const noexcept override { return model_->pixels_per_sr(d); }
    [[nodiscard]] double pixels_per_radian() const noexcept override { return model_->pixels_per_radian(); }
    [[nodiscard]] std::shared_ptr<const CameraModel> scaled(double x, double y) const override {
        return model_->scaled(x, y);
    }
    [[nodiscard]] std::shared_ptr<const CameraModel> windowed(double x, double y) const override {
        return model_->windowed(x, y);
    }
    [[nodiscard]] bool is_valid() const noexcept override { return model_->is_valid(); }
    [[nodiscard]] ProjectionParameters parameters() const override { return model_->parameters(); }

private:
    void make_cells(int side, int width, int height) {
        grid_ = {static_cast<double>(side), (width + side - 1) / side, (height + side - 1) / side};
        cells_.resize(static_cast<std::size_t>(grid_.across) * static_cast<std::size_t>(grid_.down));
        for (int row = 0; row < grid_.down; ++row)
            for (int column = 0; column < grid_.across; ++column)
                cells_[static_cast<std::size_t>(row * grid_.across + column)] = cell_at(column, row);
    }

    /// The model's directions at the products of four places of each axis of a cell.
    [[nodiscard]] Vec3Lanes directions_at(int column, int row, const std::array<double, 4>& places) const noexcept {
        const double half = 0.5 * grid_.side_px;
        Lanes<double> x, y;
        for (std::size_t i = 0; i < kTerms; ++i) {
            x[i] = column * grid_.side_px - 0.5 + half * (1 + places[i % 4]);
            y[i] = row * grid_.side_px - 0.5 + half * (1 + places[i / 4]);
        }
        Vec3Lanes out;
        model_->directions({}, x, y, out);
        return out;
    }

    [[nodiscard]] Cell cell_at(int column, int row) const noexcept {
        static_assert(kTerms == kLanes);
        const Vec3Lanes nodes = directions_at(column, row, {-kNodes[0], -kNodes[1], kNodes[1], kNodes[0]});
        Cell cell{{nodes.x, nodes.y, nodes.z}, false};
        for (auto& terms : cell.terms) {
            for (std::size_t j = 0; j < 4; ++j) to_powers(&terms[4 * j], 1);
            for (std::size_t i = 0; i < 4; ++i) to_powers(&terms[i], 4);
        }
        // The error of the cubic is largest at the ends, and between the nodes.
        constexpr std::array<double, 4> kTested{-1, -0.7, 0.1, 1};
        constexpr double kBetweenTested = 4;  // how much larger it may be elsewhere
        const Vec3Lanes exact = directions_at(column, row, kTested);
        const double side_rad = norm(exact[kTerms - 1] - exact[0]) / std::numbers::sqrt2;
        double largest = 0;
        for (std::size_t i = 0; i < kTerms; ++i) {
            const Vec3 found = direction_at(cell, kTested[i % 4], kTested[i / 4]);
            largest = std::max(largest, norm(found - exact[i]));
        }
        cell.is_tabulated = kBetweenTested * largest * grid_.side_px < kTabulatedError_px * side_rad;
        return cell;
    }

    /// The same as `directions`.
    [[nodiscard]] Vec3 one_direction(const ImagePoint& p) const noexcept {
        const CellGrid::CellBounds bounds = grid_.cell_at(p.x, p.y);
        const Cell& cell = cells_[grid_.number(bounds)];
        const double x = grid_.within(p.x, bounds.column), y = grid_.within(p.y, bounds.row);
        return cell.is_tabulated && bounds.contains(x, y) ? direction_at(cell, x, y) : model_->direction(p);
    }

    std::shared_ptr<const CameraModel> model_;
    CellGrid grid_{};
    std::vector<Cell> cells_{};
};

}  // namespace

std::shared_ptr<const CameraModel> tabulated(std::shared_ptr<const CameraModel> model, int width, int height) {
    if (model->pinhole() != nullptr || !model->is_valid()) return model;
    return std::make_shared<TabulatedModel>(std::move(model), width, height);
}

}  // namespace narpa
