#include "renderer/film/sample_plan.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "renderer/integrator/sampler.h"

namespace narpa {
namespace {

/// How pixels are weighed against typical edges.
struct Weighing {
    /// Edges move by less than a pixel, and thin parts are met by the middles now and then only: pixels beside an
    /// edge get this part of its variance, those next to them that.
    float beside, next_but_one;
    /// Of a pixel that is much like its neighbours, in terms of a typical edge's weight. About some all is the very
    /// same, as in empty space: they have an eighth of that (kEventful).
    double least;
    /// Of a pixel whose middle met nothing: thin parts of a body may pass between the middles, as its bounds are
    /// there, and to look for them costs one ray and no shading. In doublings of `least`.
    int empty;
};
/// Of what their middles show, pixels off an edge have a hundredth of its variance and less. Where paths are
/// followed, a pixel's edges are told by its neighbours alone; and some light is so rare that no middle has met it.
constexpr Weighing kByDirectLight{0.05f, 0.01f, 1.0 / 128, 2}, kByPaths{0.25f, 0.04f, 1.0 / 16, 0};
/// Along an edge of little contrast there may be a glint that no middle met: so much of a typical variance is taken
/// for granted.
constexpr float kUnseen = 0.02f;
/// The variance of edges, which falls as n^-1.5, counts to this power beside that of noise, which falls as 1/n: of
/// the variances of one sample, weights of 2/5 and of 1/2.
constexpr double kEdgePower = 0.8;

/// Paths are dear: so many doublings fewer than their noise asks for beside edges.
constexpr double kFewerPaths = 0.5;

constexpr int kRim = 2;
constexpr int kSide = kTile + 2 * kRim;
using Grid = std::array<std::array<float, kSide>, kSide>;

/// The greatest and the sum of 2 r + 1 neighbours.
template <class Value, class Fold>
float fold(int r, Value&& value, Fold&& with) {
    float sum = value(-r);
    for (int k = 1 - r; k <= r; ++k) sum = with(sum, value(k));
    return sum;
}

// What has a pixel's own middle in it are its own values and those of the four beside it: the cross.
float at_cross(const Grid& g, int x, int y) {
    return g[y][x] + g[y][x - 1] + g[y][x + 1] + g[y - 1][x] + g[y + 1][x];
}
/// The greatest of the four beyond it, and of those two columns off.
float at_corners(const Grid& g, int x, int y) {
    return std::max({g[y - 1][x - 1], g[y - 1][x + 1], g[y + 1][x - 1], g[y + 1][x + 1]});
}
float at_sides(const Grid& g, int x, int y) {
    float greatest = 0;
    for (int k = -1; k <= 1; ++k) greatest = std::max({greatest, g[y + k][x - 2], g[y + k][x + 2]});
    return greatest;
}

}  // namespace

SamplePlan::SamplePlan(std::size_t tiles)
    : contrasts_(tiles), weights_(tiles), path_weights_(tiles), sums_(tiles) {}

void SamplePlan::weigh(const Frame& f, const GBuffer& looks, std::span<const std::uint32_t> tiles) {
    constexpr std::size_t kGrain = 16;
    using Range = tbb::blocked_range<std::size_t>;
    tbb::parallel_for(
        Range(0, tiles.size(), kGrain),
        [&](const Range& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) contrast_tile(f, looks, tiles[i]);
        },
        tbb::simple_partitioner());
    Sums all;
    for (const std::uint32_t tile : tiles) {
        all.variance += sums_[tile].variance;
        all.deviation += sums_[tile].deviation;
        all.met += sums_[tile].met;
    }
    met_ = all.met;
    first_ = std::countr_zero(f.quick ? kFewest : kFewestOfPaths) * kPerDoubling;
    const double typical = all.variance > 0 ? all.variance / all.deviation : 1;
    for (auto* const histogram : {&histogram_, &path_histogram_})
        for (auto& bin : *histogram) bin.store(0, std::memory_order_relaxed);
    tbb::parallel_for(
        Range(0, tiles.size(), kGrain),
        [&](const Range& range) {
            Histogram histogram{}, of_paths{};
            for (std::size_t i = range.begin(); i != range.end(); ++i)
                weigh_tile(f, looks, tiles[i], typical * typical, histogram, of_paths);
            for (std::size_t w = 0; w < histogram.size(); ++w) {
                if (histogram[w] > 0) histogram_[w].fetch_add(histogram[w], std::memory_order_relaxed);
                if (of_paths[w] > 0) path_histogram_[w].fetch_add(of_paths[w], std::memory_order_relaxed);
            }
        },
        tbb::simple_partitioner());
}

void SamplePlan::contrast_tile(const Frame& f, const GBuffer& looks, std::size_t tile) noexcept {
    TileContrast& c = contrasts_[tile];
    looks.contrast(f, tile, c);
    Sums sums;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
        const double variance = static_cast<double>(c.edge[i] + std::max(c.noise[i], 0.0f));
        sums.shared += static_cast<double>(c.shared[i]);
        sums.paths += static_cast<double>(c.shared[i] + std::max(c.noise[i], 0.0f));
        sums.variance += variance;
        sums.deviation += std::sqrt(variance);
        sums.met += looks.tile(tile).surface[i] != 0;
    }
    sums_[tile] = sums;
}

float SamplePlan::around(const GBuffer& looks, std::size_t tile, double Sums::*variance) const noexcept {
    const int tx = static_cast<int>(tile) % looks.tiles_x(), ty = static_cast<int>(tile) / looks.tiles_x();
    double sum = 0, met = 0;
    for (int y = std::max(ty - 1, 0); y <= std::min(ty + 1, looks.tiles_y() - 1); ++y)
        for (int x = std::max(tx - 1, 0); x <= std::min(tx + 1, looks.tiles_x() - 1); ++x) {
            const auto from = static_cast<std::size_t>(y * looks.tiles_x() + x);
            if (from == tile || !looks.looked_at(from)) continue;
            sum += sums_[from].*variance;
            met += static_cast<double>(sums_[from].met);
        }
    return met > 0 ? static_cast<float>(sum / met) : 0;
}

int SamplePlan::in_step(int weight, int even, int of_paths, bool sees) noexcept {
    if (weight - even < kPerDoubling) return sees || weight > of_paths ? of_paths : weight;
    return of_paths + (weight - even) / kPerDoubling * kPerDoubling;
}

void SamplePlan::weigh_tile(const Frame& f, const GBuffer& looks, std::size_t tile, double typical_variance,
                            Histogram& histogram, Histogram& of_paths) noexcept {
    const int tx = static_cast<int>(tile) % looks.tiles_x(), ty = static_cast<int>(tile) / looks.tiles_x();
    const Weighing& w = f.quick ? kByDirectLight : kByPaths;
    const float shared_around = f.quick ? 0 : around(looks, tile, &Sums::shared);
    const auto doublings_of = [&](double variance) {
        return std::log2(std::max(std::sqrt(variance), w.least) / w.least);
    };
    int even = 0;  ///< weight of paths, but for the hash
    path_weights_[tile] = f.quick ? 0 : kWeights - 1;
    if (f.sun_first) {
        const double variance = static_cast<double>(around(looks, tile, &Sums::paths)) / typical_variance;
        const auto hash = static_cast<int>(sampler_detail::mix(tile) % kPerDoubling);
        const double doublings = doublings_of(variance);
        even = kEventful + static_cast<int>(kPerDoubling * std::max(0.0, doublings - kFewerPaths));
        path_weights_[tile] = static_cast<Weight>(std::min(even + hash, kWeights - 1));
    }
    Grid edge{}, noise{}, known{};
    const float unseen = kUnseen / 12 * static_cast<float>(typical_variance);
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            const int px = tx * kTile + x - kRim, py = ty * kTile + y - kRim;
            if (px < 0 || py < 0 || px >= looks.width() || py >= looks.height()) continue;
            const auto from = static_cast<std::size_t>(py / kTile * looks.tiles_x() + px / kTile);
            if (!looks.looked_at(from)) continue;
            const std::size_t place = place_in_tile(px % kTile, py % kTile);
            edge[y][x] = contrasts_[from].edge[place] + unseen * contrasts_[from].breaks[place];
            known[y][x] = contrasts_[from].noise[place] >= 0 ? 1.0f : 0.0f;
            noise[y][x] = std::max(contrasts_[from].noise[place], 0.0f);
        }
    // Along the rows, then along the columns.
    Grid near{}, far{}, noises{}, knowns{};
    const auto greater = [](float a, float b) { return std::max(a, b); };
    const auto plus = [](float a, float b) { return a + b; };
    for (int y = 0; y < kSide; ++y)
        for (int x = kRim; x < kSide - kRim; ++x) {
            const auto row = [&](const Grid& g) { return [&g, x, y](int k) { return g[y][x + k]; }; };
            near[y][x] = fold(1, row(edge), greater);
            far[y][x] = fold(2, row(edge), greater);
            noises[y][x] = fold(2, row(noise), plus);
            knowns[y][x] = fold(2, row(known), plus);
        }
    for (int y = kRim; y < kSide - kRim; ++y)
        for (int x = kRim; x < kSide - kRim; ++x) {
            const int px = tx * kTile + x - kRim, py = ty * kTile + y - kRim;
            const std::size_t place = place_in_tile(x - kRim, y - kRim);
            if (px >= looks.width() || py >= looks.height()) {
                weights_[tile][place] = -1;
                continue;
            }
            const auto column = [&](const Grid& g) { return [&g, x, y](int k) { return g[y + k][x]; }; };
            float edges = std::max({edge[y][x], w.beside * fold(1, column(near), greater),
                                    w.next_but_one * fold(2, column(far), greater)});
            if (!f.quick) {
                const float seen = at_corners(edge, x, y);
                const float breaks = contrasts_[tile].breaks[place];
                edges = std::max({breaks > 0 ? std::max(seen, unseen * breaks) : 0.0f, w.beside * seen,
                                  w.next_but_one * std::max({far[y - 2][x], far[y + 2][x], at_sides(edge, x, y)})});
            }
            const float neighbours = fold(2, column(knowns), plus) - at_cross(known, x, y);
            const float noisy =
                neighbours > 0 ? std::max(fold(2, column(noises), plus) - at_cross(noise, x, y), 0.0f) / neighbours
                               : 0.0f;
            const float shared = looks.tile(tile).surface[place] != 0 ? shared_around : 0;
            const double variance = std::pow(static_cast<double>(edges) / typical_variance, kEdgePower) +
                                    static_cast<double>(noisy + shared) / typical_variance;
            const double doublings = doublings_of(variance);
            const auto hash = sampler_detail::mix(tile * kTilePixels + place) % kPerDoubling;
            const bool empty = looks.tile(tile).surface[place] == 0;
            const int event = std::max(variance > 0 ? kEventful + static_cast<int>(kPerDoubling * doublings) : 0,
                                       empty ? kEventful + w.empty * kPerDoubling : 0);
            int weight = event + static_cast<int>(hash);
            if (f.sun_first) weight = in_step(weight, even, path_weights_[tile], !empty);
            weights_[tile][place] = static_cast<Weight>(std::min(weight, kWeights - 1));
            ++histogram[static_cast<std::size_t>(weights_[tile][place])];
            ++of_paths[static_cast<std::size_t>(std::min(weights_[tile][place], path_weights_[tile]))];
        }
}

std::uint64_t SamplePlan::total(Stage stage) const noexcept {
    std::uint64_t sum = 0;
    for (int w = 0; w < kWeights; ++w)
        sum += std::uint64_t{histogram_[static_cast<std::size_t>(w)].load(std::memory_order_relaxed)} *
               count(static_cast<Weight>(w), stage);
    return sum;
}

std::uint64_t SamplePlan::total_paths(Stage stage) const noexcept {
    std::uint64_t sum = 0;
    for (int w = 0; w < kWeights; ++w) {
        const auto bin = static_cast<std::size_t>(w);
        const std::uint32_t n = count(static_cast<Weight>(w), stage);
        sum += std::uint64_t{histogram_[bin].load(std::memory_order_relaxed)} * paths(n, 0) +
               std::uint64_t{path_histogram_[bin].load(std::memory_order_relaxed)} * (n - paths(n, 0));
    }
    return sum;
}

template <class Fits>
SamplePlan::Stage SamplePlan::furthest(Stage from, Fits&& fits) noexcept {
    int within = std::max(from.level, -kWeights), beyond = kFull + 1;
    while (within + 1 < beyond) {
        const int middle = within + (beyond - within) / 2;
        (fits(Stage{middle}) ? within : beyond) = middle;
    }
    return {within};
}

SamplePlan::Stage SamplePlan::reach(Stage from, std::uint64_t samples) const noexcept {
    const std::uint64_t most = total(from) + samples;
    return furthest(from, [&](Stage stage) { return total(stage) <= most; });
}

SamplePlan::Stage SamplePlan::reach(Stage from, double rays, double each_sample, double each_path) const noexcept {
    const auto rays_of = [&](Stage stage) {
        return each_sample * static_cast<double>(total(stage)) +
               each_path * static_cast<double>(total_paths(stage));
    };
    const double most = rays_of(from) + rays;
    return furthest(from, [&](Stage stage) { return rays_of(stage) <= most; });
}

}  // namespace narpa
