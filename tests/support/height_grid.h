/// tests/support/height_grid.h - heights from a function, in place of a file.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "renderer/terrain/terrain_mesh.h"

namespace narpa::test {

class HeightGrid final : public HeightSource {
public:
    HeightGrid(int columns, int rows, const std::function<double(int, int)>& height, bool around = false)
        : columns_(columns), rows_(rows), around_(around) {
        for (int r = 0; r < rows; ++r)
            for (int c = 0; c < columns; ++c) heights_.push_back(height(c, r));
    }
    [[nodiscard]] int columns() const override { return columns_; }
    [[nodiscard]] int rows() const override { return rows_; }
    [[nodiscard]] bool is_global() const override { return around_; }
    [[nodiscard]] bool read_rows(int row, int count, double* heights) override {
        const auto width = static_cast<std::size_t>(columns_);
        std::copy_n(heights_.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(row) * width),
                    static_cast<std::size_t>(count) * width, heights);
        return true;
    }
    [[nodiscard]] double at(int c, int r) const { return heights_[static_cast<std::size_t>(r * columns_ + c)]; }

private:
    int columns_, rows_;
    bool around_;
    std::vector<double> heights_;
};

/// Hills and craters of all sizes, rough down to the posts.
inline double rough_ground(int c, int r) {
    double h = 0, amplitude = 40, f = 0.011;
    for (int octave = 0; octave < 7; ++octave, amplitude *= 0.3, f *= 2.03)
        h += amplitude * std::sin(f * c + 1.3 * octave) * std::cos(f * 0.9 * r + 0.7 * octave * octave);
    return h;
}

/// Posts a metre apart; x to the right, y against the rows, from the middle.
inline Placement metre_posts(int columns, int rows, double spacing_m = 1) {
    Placement p;
    p.map = {0, spacing_m, 0, 0, 0, -spacing_m};
    p.x0 = 0.5 * spacing_m * (columns - 1), p.y0 = -0.5 * spacing_m * (rows - 1);
    return p;
}

}  // namespace narpa::test
