/// renderer/dem_reader/void_detector.h - finds voids that a DEM does not mark, from the numbers of its posts.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "renderer/terrain/height_source.h"

namespace narpa {

/// Takes each row of a DEM once, from the first to the last, and names numbers that look like marks of missing
/// data: limits of the numbers' type and the usual marks (-9999 ...) that are the lowest or highest of all and far
/// from the rest, and steps between neighbours that are steeper than 87 degrees.
class VoidDetector {
public:
    /// `type_lowest` and `type_highest`: limits of an integer type that are likely marks; NaN: none.
    VoidDetector(double type_lowest, double type_highest)
        : low_{.limit = type_lowest}, high_{.limit = type_highest} {}

    /// Distance of posts, the larger one of rows and columns, metres: before the first row.
    void set_spacing(double spacing_m) { spacing_m_ = spacing_m; }
    /// `numbers` as stored; `heights`: NaN where the post has none. Rows that were taken already are passed over.
    void add_row(int row, std::span<const double> numbers, std::span<const double> heights);
    /// Posts whose height is beyond what a planet has, and which are holes therefore.
    void count_unusable(std::uint64_t posts) { unusable_ += posts; }
    [[nodiscard]] int next_row() const { return next_row_; }
    [[nodiscard]] std::vector<std::string> warnings() const;

private:
    struct Extreme {
        double limit = kNoHeight, number = kNoHeight, next = kNoHeight;  ///< next: the second lowest or highest
        std::uint64_t posts = 0;
        void add(double x, double sign);
        [[nodiscard]] bool is_suspect(double other_extreme) const;
        [[nodiscard]] std::string warning(const char* which) const;
    };
    struct Step {
        double from_m = 0, to_m = 0;
        int row = 0, column = 0;
        std::uint64_t count = 0;
    };
    void add_step(double from, double to, int row, int column);

    Extreme low_, high_;
    Step step_;
    double spacing_m_ = 0;
    int next_row_ = 0;
    std::uint64_t unusable_ = 0;
    std::vector<double> last_;  ///< heights of the row before
};

}  // namespace narpa
