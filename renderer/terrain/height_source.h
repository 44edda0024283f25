/// renderer/terrain/height_source.h - a grid of surveyed heights, the posts of a digital elevation model (DEM).
#pragma once

#include <limits>

namespace narpa {

/// The height of a post where there is no data.
inline constexpr double kNoHeight = std::numeric_limits<double>::quiet_NaN();

/// Heights in metres, by column (to the right in the file) and row (down). Windows are read on demand.
class HeightSource {
public:
    virtual ~HeightSource() = default;
    HeightSource() = default;
    HeightSource(const HeightSource&) = delete;
    HeightSource& operator=(const HeightSource&) = delete;

    [[nodiscard]] virtual int columns() const = 0;
    [[nodiscard]] virtual int rows() const = 0;
    /// True if the grid goes around the planet: the last column is the first again.
    [[nodiscard]] virtual bool is_global() const { return false; }
    /// Rows `row` to `row + count - 1`, all columns, row by row. False where they cannot be read.
    [[nodiscard]] virtual bool read_rows(int row, int count, double* heights) = 0;
};

}  // namespace narpa
