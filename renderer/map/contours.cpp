#include "renderer/map/contours.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

namespace narpa {
namespace {

/// A side of cells: 2 i from pixel i to its right neighbour, 2 i + 1 to the pixel below.
using Side = std::size_t;

/// Caches which sides are continuous; evaluated on demand.
class Sides {
public:
    Sides(const ScalarField& field, const IsContinuous& is_continuous)
        : width_(static_cast<std::size_t>(field.width)),
          is_continuous_(is_continuous),
          known_(2 * field.values.size(), Known::nothing) {}

    [[nodiscard]] std::pair<std::size_t, std::size_t> pixels(Side side) const {
        return {side / 2, side / 2 + (side % 2 == 0 ? 1 : width_)};
    }
    [[nodiscard]] bool continuous(Side side) {
        if (known_[side] == Known::nothing) {
            const auto [a, b] = pixels(side);
            known_[side] = is_continuous_(a, b) ? Known::continuous : Known::broken;
        }
        return known_[side] == Known::continuous;
    }

private:
    enum class Known : std::uint8_t { nothing, continuous, broken };
    std::size_t width_;
    const IsContinuous& is_continuous_;
    std::vector<Known> known_;
};

/// Corners and sides clockwise (y down), from the top left corner and the top side.
struct Cell {
    std::array<double, 4> corner;
    std::array<Side, 4> side;

    Cell(const ScalarField& field, std::size_t top_left) {
        const auto width = static_cast<std::size_t>(field.width);
        const std::size_t below = top_left + width;
        corner = {field.values[top_left], field.values[top_left + 1], field.values[below + 1], field.values[below]};
        side = {2 * top_left, 2 * (top_left + 1) + 1, 2 * below, 2 * top_left + 1};
    }
};

/// A piece of a line within one cell, from side to side.
struct Segment {
    Side from, to;
};

[[nodiscard]] bool is_above(double value, double level) noexcept {
    return value >= level - kLevelTolerance;
}

/// Clockwise round the cell, each segment starts on a side where the values rise through the level and ends on one
/// where they fall. The neighbouring cell sees these the other way round, so that segments join head to tail.
void add_segments(const Cell& cell, double level, std::vector<Segment>& out) {
    std::size_t first = 0;  // corner below the level
    while (first < 4 && is_above(cell.corner[first], level)) ++first;
    std::array<Side, 2> rise{}, fall{};  // fall[i] comes next after rise[i]
    std::size_t rises = 0, falls = 0;
    for (std::size_t k = first; k < first + 4; ++k) {
        const bool here = is_above(cell.corner[k % 4], level), next = is_above(cell.corner[(k + 1) % 4], level);
        if (!here && next) rise[rises++] = cell.side[k % 4];
        if (here && !next) fall[falls++] = cell.side[k % 4];
    }
    if (rises == 2) {
        // The bilinear saddle is above the level where the product of the two corners above exceeds that of the two
        // below, all counted from the level. The segments then cut off the corners below.
        const auto from_level = [&](std::size_t k) { return cell.corner[(first + k) % 4] - level; };
        if (from_level(1) * from_level(3) >= from_level(0) * from_level(2)) std::swap(fall[0], fall[1]);
    }
    for (std::size_t i = 0; i < rises; ++i) out.push_back({rise[i], fall[i]});
}

/// The segments of each level.
std::vector<std::vector<Segment>> find_segments(const ScalarField& field, std::span<const double> levels,
                                                Sides& sides) {
    std::vector<std::vector<Segment>> found(levels.size());
    for (int y = 0; y + 1 < field.height; ++y)
        for (int x = 0; x + 1 < field.width; ++x) {
            const Cell cell(field, static_cast<std::size_t>(y) * static_cast<std::size_t>(field.width) +
                                       static_cast<std::size_t>(x));
            if (std::ranges::any_of(cell.corner, [](double v) { return std::isnan(v); })) continue;
            const auto values = std::ranges::minmax(cell.corner);
            const auto crosses = [&](double level) {
                return !is_above(values.min, level) && is_above(values.max, level);
            };
            auto level = std::ranges::lower_bound(levels, values.min);
            while (level != levels.end() && is_above(values.min, *level)) ++level;
            if (level == levels.end() || !crosses(*level)) continue;
            if (!std::ranges::all_of(cell.side, [&](Side side) { return sides.continuous(side); })) continue;
            for (; level != levels.end() && crosses(*level); ++level)
                add_segments(cell, *level, found[static_cast<std::size_t>(level - levels.begin())]);
        }
    return found;
}

ImagePoint crossing(const ScalarField& field, const Sides& sides, Side side, double level) {
    const auto [a, b] = sides.pixels(side);
    const double value_a = field.values[a], value_b = field.values[b];
    const double t = std::clamp((level - value_a) / (value_b - value_a), 0.0, 1.0);
    const auto width = static_cast<std::size_t>(field.width);
    const auto x = static_cast<double>(a % width), y = static_cast<double>(a / width);
    return side % 2 == 0 ? ImagePoint{x + t, y} : ImagePoint{x, y + t};
}

/// Joins the segments of one level, open lines first.
void join(const ScalarField& field, const Sides& sides, double level, std::vector<Segment> segments,
          std::vector<ContourLine>& out) {
    std::ranges::sort(segments, {}, &Segment::from);
    std::vector<Side> ends;
    for (const Segment& s : segments) ends.push_back(s.to);
    std::ranges::sort(ends);
    std::vector<bool> used(segments.size(), false);

    const auto follow = [&](std::size_t i) {
        ContourLine line{level, false, {}};
        const auto add = [&](Side side) {
            const ImagePoint p = crossing(field, sides, side, level);
            if (line.points.empty() || p.x != line.points.back().x || p.y != line.points.back().y)
                line.points.push_back(p);
        };
        const Side start = segments[i].from;
        add(start);
        Side at = start;
        do {
            used[i] = true;
            at = segments[i].to;
            add(at);
            i = static_cast<std::size_t>(std::ranges::lower_bound(segments, at, {}, &Segment::from) -
                                         segments.begin());
        } while (at != start && i < segments.size() && segments[i].from == at);
        line.closed = at == start;
        if (line.points.size() > 1) out.push_back(std::move(line));
    };
    for (std::size_t i = 0; i < segments.size(); ++i)
        if (!std::ranges::binary_search(ends, segments[i].from)) follow(i);
    for (std::size_t i = 0; i < segments.size(); ++i)
        if (!used[i]) follow(i);
}

}  // namespace

Result<std::vector<double>> contour_levels(double lowest, double highest, double interval) {
    if (!(interval > 0) || !std::isfinite(interval))
        return Error{fmt::format("an interval of {:g} m between contour lines, expected more than 0", interval)};
    const double first = std::ceil(lowest / interval), last = std::floor(highest / interval);
    if (last - first >= kMaxContourLevels)
        return Error{
            fmt::format("an interval of {:g} m has {:.0f} levels between {:.6g} and {:.6g} m, expected at "
                        "most {}: take {:.2g} m or more",
                        interval, last - first + 1, lowest, highest, kMaxContourLevels,
                        1.05 * (highest - lowest) / kMaxContourLevels)};
    std::vector<double> levels;
    for (double k = first; k <= last; ++k) levels.push_back(k * interval);
    return levels;
}

std::vector<ContourLine> contour_lines(const ScalarField& field, std::span<const double> levels,
                                       const IsContinuous& is_continuous) {
    Sides sides(field, is_continuous);
    const auto segments = find_segments(field, levels, sides);
    std::vector<ContourLine> lines;
    for (std::size_t i = 0; i < levels.size(); ++i) join(field, sides, levels[i], segments[i], lines);
    return lines;
}

}  // namespace narpa
