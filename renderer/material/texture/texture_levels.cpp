#include <algorithm>

#include "renderer/material/texture/texture_lookup.h"

namespace narpa {
namespace {

/// The sums are integers, at most 65535 * width * height, so doubles hold them exactly up to this number of texels.
constexpr std::size_t kMaxTexels = std::size_t{1} << 37;

/// Position along the finest level where one texel of a coarser level ends and the next begins: `whole` texels and
/// `part` / n of the next one, where n is the number of coarse texels.
struct Edge {
    std::size_t whole;
    double part;
};

/// Accumulates one coarser level in a pass over the rows of the finest.
struct Reducer {
    Texture::Level level;
    std::vector<Edge> edges;  ///< along x, width + 1 of them
    std::vector<double> sum;  ///< of the current row of texels, times width * height of this level
    std::size_t row = 0;      ///< the current row

    Reducer(int fine_width, int width, int height)
        : level{width, height, {}}, sum(3 * static_cast<std::size_t>(width), 0.0) {
        level.rgb.resize(sum.size() * static_cast<std::size_t>(height));
        const auto n = static_cast<std::size_t>(width), m = static_cast<std::size_t>(fine_width);
        for (std::size_t i = 0; i <= n; ++i) edges.push_back({i * m / n, static_cast<double>(i * m % n)});
    }

    /// `below` holds at 3 x + band the sum of a row's texels left of x, and `texels` the row; it counts `weight`
    /// times.
    void add(const std::vector<double>& below, const std::uint16_t* texels, double weight) {
        const double n = level.width;
        const auto sum_to = [&](const Edge& e, std::size_t band) {
            const std::size_t at = 3 * e.whole + band;
            return n * below[at] + (e.part > 0 ? e.part * texels[at] : 0.0);
        };
        for (std::size_t band = 0; band < 3; ++band) {
            double left = 0;
            for (std::size_t i = 1; i < edges.size(); ++i) {
                const double right = sum_to(edges[i], band);
                sum[3 * (i - 1) + band] += weight * (right - left);
                left = right;
            }
        }
    }

    void finish_row(double texels_of_finest) {
        std::uint16_t* out = level.rgb.data() + sum.size() * row++;
        for (double& s : sum) *out++ = static_cast<std::uint16_t>(s / texels_of_finest + 0.5), s = 0;
    }
};

}  // namespace

void build_coarser_levels(Texture& texture) {
    texture.coarser.clear();
    if (texture.width <= 0 || texture.height <= 0) return;
    const auto width = static_cast<std::size_t>(texture.width), height = static_cast<std::size_t>(texture.height);
    if (width > kMaxTexels / height || texture.rgb.size() < 3 * width * height) return;

    std::vector<Reducer> levels;
    for (int w = texture.width, h = texture.height; w > 1 || h > 1;) {
        w = std::max(1, w / 2), h = std::max(1, h / 2);
        levels.emplace_back(texture.width, w, h);
    }
    std::vector<double> below(3 * (width + 1), 0.0);
    const double texels = static_cast<double>(width) * static_cast<double>(height);
    for (std::size_t y = 0; y < height; ++y) {
        const std::uint16_t* row = texture.rgb.data() + 3 * width * y;
        for (std::size_t i = 0; i < 3 * width; ++i) below[i + 3] = below[i] + row[i];
        for (Reducer& l : levels) {
            // In units of 1 / `rows` of a texel of the finest level: `here`, end of this row; `there`, end of the
            // coarse row.
            const auto rows = static_cast<std::size_t>(l.level.height);
            const std::size_t here = (y + 1) * rows, there = (l.row + 1) * height;
            const std::size_t over = here > there ? here - there : 0;
            l.add(below, row, static_cast<double>(rows - over));
            if (here < there) continue;
            l.finish_row(texels);
            if (over > 0) l.add(below, row, static_cast<double>(over));
        }
    }
    for (Reducer& l : levels) texture.coarser.push_back(std::move(l.level));
}

}  // namespace narpa
