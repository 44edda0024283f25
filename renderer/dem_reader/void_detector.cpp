#include "renderer/dem_reader/void_detector.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace narpa {
namespace {

constexpr double kSteepest = 20;    // of a height's step over the posts' distance: 87 degrees
constexpr double kFarShare = 0.02;  // of the range of the other numbers: so far from them an extreme is no summit
/// Numbers that files and tools use for missing heights.
constexpr double kUsualMarks[]{-999,   -9999,  -99999, -999999,       9999,        99999, 999999,
                               -32767, -32768, 32767,  65535,         -1e4,        -1e5,  -1e6,
                               -3e4,   -32766, 65534,  -2147483648.0, 2147483647.0};

bool is_usual_mark(double number) {
    return std::ranges::find(kUsualMarks, number) != std::end(kUsualMarks);
}

}  // namespace

/// `sign`: 1 for the highest, -1 for the lowest.
void VoidDetector::Extreme::add(double x, double sign) {
    if (x == number) {
        ++posts;
    } else if (posts == 0 || sign * x > sign * number) {
        next = number, number = x, posts = 1;
    } else if (!(sign * x <= sign * next)) {
        next = x;
    }
}

bool VoidDetector::Extreme::is_suspect(double other_extreme) const {
    const bool far = std::abs(number - next) > kFarShare * std::abs(next - other_extreme);
    return (number == limit || is_usual_mark(number)) && far;
}

std::string VoidDetector::Extreme::warning(const char* which) const {
    return fmt::format(
        "the number {:.10g} of {} of its posts, {}, is not marked as missing data and is used as a "
        "height; no_data = {:.10g} makes holes of such posts",
        number, posts, number == limit ? fmt::format("the {} of its type", which) : "a usual mark of voids",
        number);
}

void VoidDetector::add_step(double from, double to, int row, int column) {
    if (!(std::abs(to - from) > kSteepest * spacing_m_)) return;
    const std::uint64_t count = step_.count + 1;
    if (count == 1 || std::abs(to - from) > std::abs(step_.to_m - step_.from_m)) step_ = {from, to, row, column, 0};
    step_.count = count;
}

void VoidDetector::add_row(int row, std::span<const double> numbers, std::span<const double> heights) {
    if (row < next_row_) return;
    if (row > next_row_) last_.clear();
    next_row_ = row + 1;
    double west = kNoHeight;
    last_.resize(heights.size(), kNoHeight);
    for (std::size_t c = 0; c < heights.size(); ++c) {
        const double h = heights[c], n = numbers[c];
        const bool known = h == h;
        if (known) low_.add(n, -1), high_.add(n, 1);
        const double plain = known && !is_usual_mark(n) && n != low_.limit && n != high_.limit ? h : kNoHeight;
        add_step(west, plain, row, static_cast<int>(c));
        add_step(last_[c], plain, row, static_cast<int>(c));
        west = last_[c] = plain;
    }
}

std::vector<std::string> VoidDetector::warnings() const {
    std::vector<std::string> out;
    if (low_.is_suspect(high_.number)) out.push_back(low_.warning("lowest"));
    if (high_.is_suspect(low_.number)) out.push_back(high_.warning("highest"));
    if (step_.count > 0)
        out.push_back(
            fmt::format("{} steps between neighbouring posts are steeper than 87 degrees, the highest from "
                        "{:.6g} to {:.6g} m at column {}, row {}: a wrong scale, or voids that it does not "
                        "mark (no_data names their number)?",
                        step_.count, step_.from_m, step_.to_m, step_.column, step_.row));
    if (unusable_ > 0)
        out.push_back(fmt::format("{} of its posts have no finite height within 1e9 m, and are holes", unusable_));
    return out;
}

}  // namespace narpa
