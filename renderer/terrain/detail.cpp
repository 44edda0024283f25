#include "renderer/terrain/detail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "renderer/terrain/crater_profile.h"

namespace narpa {
namespace {

/// Uniform random numbers, a stream for each cell of each class of diameters (S. Vigna's splitmix64).
class CellRandom {
public:
    CellRandom(std::uint64_t seed, std::uint64_t stream, std::int64_t column, std::int64_t row)
        : state_(
              mixed(mixed(mixed(seed + 0x9e37'79b9'7f4a'7c15ull) ^ stream) ^ static_cast<std::uint64_t>(column)) ^
              (static_cast<std::uint64_t>(row) * 0xd134'2543'de82'ef95ull)) {}
    double uniform() {
        state_ += 0x9e37'79b9'7f4a'7c15ull;
        return static_cast<double>(mixed(state_) >> 11) * 0x1p-53;
    }
    int poisson(double mean) {
        int n = 0;
        for (double p = uniform(), limit = std::exp(-mean); p > limit && n < 64; p *= uniform()) ++n;
        return n;
    }

private:
    static std::uint64_t mixed(std::uint64_t z) {
        z = (z ^ (z >> 30)) * 0xbf58'476d'1ce4'e5b9ull;
        z = (z ^ (z >> 27)) * 0x94d0'49bb'1331'11ebull;
        return z ^ (z >> 31);
    }
    std::uint64_t state_;
};

double rock_profile(double r) {
    return r < 1 ? 0.5 * std::sqrt(1 - r * r) : 0;
}

/// Number of rocks per square metre with diameters from `d` to `to`: the area share of each step over the area of a
/// rock.
double rocks_between(double k, double d, double to) {
    const double q = 1.79 + 0.152 / k;
    constexpr int kSteps = 32;
    double n = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double a = d + (to - d) * i / kSteps, b = d + (to - d) * (i + 1) / kSteps, middle = 0.5 * (a + b);
        n += k * (std::exp(-q * a) - std::exp(-q * b)) / (0.25 * std::numbers::pi * middle * middle);
    }
    return n;
}

/// Catmull-Rom weights of four posts at position t between the second and the third (E. Catmull, R. Rom, "A class
/// of local interpolating splines", 1974).
std::array<double, 4> spline_weights(double t) {
    return {((2 - t) * t - 1) * t / 2, ((3 * t - 5) * t * t + 2) / 2, ((4 - 3 * t) * t + 1) * t / 2,
            (t - 1) * t * t / 2};
}

/// Four rows of posts about a row of cells.
struct CellRows {
    std::array<const double*, 4> row;
    int columns;
    bool around;  ///< the last column is the first again

    [[nodiscard]] std::size_t column(int c) const {
        if (around) return static_cast<std::size_t>((c + columns - 1) % (columns - 1));
        return static_cast<std::size_t>(std::clamp(c, 0, columns - 1));
    }
    /// Height at (u, v) in the cell that begins at column c: a bicubic spline; if one of the sixteen posts about
    /// the cell has no height, linear on its two triangles.
    [[nodiscard]] double height(int c, double u, double v) const {
        if (u == 0 && v == 0) return row[1][column(c)];
        const std::array<std::size_t, 4> at{column(c - 1), column(c), column(c + 1), column(c + 2)};
        const std::array<double, 4> across = spline_weights(u), down = spline_weights(v);
        double sum = 0;
        for (std::size_t j = 0; j < 4; ++j)
            for (std::size_t i = 0; i < 4; ++i) sum += down[j] * across[i] * row[j][at[i]];
        return sum == sum ? sum : on_triangles(row[1][at[1]], row[1][at[2]], row[2][at[2]], row[2][at[1]], u, v);
    }
    static double on_triangles(double nw, double ne, double se, double sw, double u, double v) {
        return u >= v ? nw + u * (ne - nw) + v * (se - ne) : nw + v * (sw - nw) + u * (se - sw);
    }
};

}  // namespace

DetailedSource::DetailedSource(HeightSource& coarse, const PostSpacing& spacing, const TerrainDetail& detail)
    : coarse_(coarse),
      spacing_{spacing.x_m / detail.refinement_factor, spacing.y_m / detail.refinement_factor},
      detail_(detail) {
    constexpr double kStep = 1.189207115002721;  // 2^(1/4): within a step, numbers fall as D^-2
    const double least = 2 * std::max(spacing_.x_m, spacing_.y_m);
    for (double high = 2 * std::max(spacing.x_m, spacing.y_m); high > 1.005 * least; high /= kStep) {
        const double low = std::max(high / kStep, least);
        if (detail.craters > 0)
            sizes_.push_back({low, high, detail.craters * (1 / (low * low) - 1 / (high * high)), false});
        if (detail.rocks > 0) sizes_.push_back({low, high, rocks_between(detail.rocks, low, high), true});
    }
}

int DetailedSource::columns() const {
    return (coarse_.columns() - 1) * detail_.refinement_factor + 1;
}
int DetailedSource::rows() const {
    return (coarse_.rows() - 1) * detail_.refinement_factor + 1;
}

bool DetailedSource::read_rows(int row, int count, double* heights) {
    const int n = detail_.refinement_factor, width = columns(), coarse_rows = coarse_.rows();
    const auto coarse_width = static_cast<std::size_t>(coarse_.columns());
    // Two posts on either side of each cell.
    const int first = std::max(row / n - 1, 0), last = std::min((row + count - 1) / n + 2, coarse_rows - 1);
    coarse_rows_.resize(static_cast<std::size_t>(last - first + 1) * coarse_width);
    if (!coarse_.read_rows(first, last - first + 1, coarse_rows_.data())) return false;
    const auto row_at = [&](int r) {
        return &coarse_rows_[static_cast<std::size_t>(std::clamp(r, 0, coarse_rows - 1) - first) * coarse_width];
    };
    for (int i = 0; i < count; ++i) {
        const int r = (row + i) / n;
        const CellRows rows{{row_at(r - 1), row_at(r), row_at(r + 1), row_at(r + 2)},
                            static_cast<int>(coarse_width),
                            coarse_.is_global()};
        const double v = static_cast<double>((row + i) % n) / n;
        double* const out = heights + static_cast<std::size_t>(i) * static_cast<std::size_t>(width);
        for (int k = 0; k < width; ++k) out[k] = rows.height(k / n, static_cast<double>(k % n) / n, v);
    }
    for (std::size_t i = 0; i < sizes_.size(); ++i) add_features(sizes_[i], i, row, count, heights);
    return true;
}

/// Each class of diameters has a grid of cells, eight times as wide as its largest diameter, with a random number
/// of features in each.
void DetailedSource::add_features(const Sizes& sizes, std::uint64_t stream, int row, int count,
                                  double* heights) const {
    const double cell_m = 8 * sizes.high_m, reach_m = (sizes.rocks ? 0.5 : 0.5 * kCraterReach) * sizes.high_m;
    const int width = columns();
    const auto cell_of = [&](double m) { return static_cast<std::int64_t>(std::floor(m / cell_m)); };
    const std::int64_t last_column = cell_of(width * spacing_.x_m + reach_m),
                       last_row = cell_of((row + count) * spacing_.y_m + reach_m);
    for (std::int64_t j = cell_of(row * spacing_.y_m - reach_m); j <= last_row; ++j)
        for (std::int64_t i = cell_of(-reach_m); i <= last_column; ++i) {
            CellRandom random(detail_.seed, stream, i, j);
            for (int left = random.poisson(sizes.per_m2 * cell_m * cell_m); left > 0; --left) {
                const double x = (static_cast<double>(i) + random.uniform()) * cell_m,
                             y = (static_cast<double>(j) + random.uniform()) * cell_m, u = random.uniform(),
                             freshness = sizes.rocks ? 1 : random.uniform();
                // The number above diameter D is proportional to D^-2.
                const double a = 1 / (sizes.low_m * sizes.low_m), b = 1 / (sizes.high_m * sizes.high_m);
                const double diameter = 1 / std::sqrt(a + u * (b - a)), radius = 0.5 * diameter;
                const double reach = sizes.rocks ? radius : kCraterReach * radius;
                const int top = std::max(row, static_cast<int>(std::ceil((y - reach) / spacing_.y_m))),
                          bottom =
                              std::min(row + count - 1, static_cast<int>(std::floor((y + reach) / spacing_.y_m))),
                          from = std::max(0, static_cast<int>(std::ceil((x - reach) / spacing_.x_m))),
                          to = std::min(width - 1, static_cast<int>(std::floor((x + reach) / spacing_.x_m)));
                for (int r = top; r <= bottom; ++r)
                    for (int c = from; c <= to; ++c) {
                        const double off = std::hypot(c * spacing_.x_m - x, r * spacing_.y_m - y) / radius;
                        if (off < reach / radius)
                            heights[static_cast<std::size_t>(r - row) * static_cast<std::size_t>(width) +
                                    static_cast<std::size_t>(c)] +=
                                diameter * freshness * (sizes.rocks ? rock_profile(off) : crater_profile(off));
                    }
            }
        }
}

}  // namespace narpa
