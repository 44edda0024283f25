#include "renderer/frame/sample_plan.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "renderer/frame/tuning.h"
#include "renderer/integrator/sampler.h"

namespace narpa {
namespace {

using namespace tuning;

constexpr int kRim = 2;
constexpr int kPlanSide = kTile + 2 * kRim;
using PlanGrid = std::array<std::array<float, kPlanSide>, kPlanSide>;
constexpr std::size_t kGrain = 16;  ///< tiles per task

/// Folds 2 r + 1 neighbours.
template <class Value, class Fold>
float fold(int r, Value&& value, Fold&& with) {
    float sum = value(-r);
    for (int k = 1 - r; k <= r; ++k) sum = with(sum, value(k));
    return sum;
}
constexpr auto kGreatest = [](float a, float b) { return std::max(a, b); };
constexpr auto kSum = [](float a, float b) { return a + b; };

/// Contrasts of a tile's pixels and their neighbours up to two pixels away.
struct Neighbourhood {
    PlanGrid edge{};            ///< variance
    PlanGrid noise{}, known{};  ///< variance; 1 where it is known
};

Neighbourhood gather(const GBuffer& g_buffer, const std::vector<TileContrast>& contrasts, int tx, int ty,
                     float unseen) {
    Neighbourhood n;
    for (int y = 0; y < kPlanSide; ++y)
        for (int x = 0; x < kPlanSide; ++x) {
            const int px = tx * kTile + x - kRim, py = ty * kTile + y - kRim;
            if (px < 0 || py < 0 || px >= g_buffer.width() || py >= g_buffer.height()) continue;
            const auto tile = static_cast<std::size_t>(py / kTile * g_buffer.tiles_x() + px / kTile);
            if (!g_buffer.is_traced(tile)) continue;
            const std::size_t place = place_in_tile(px % kTile, py % kTile);
            const TileContrast& c = contrasts[tile];
            n.edge[y][x] = c.edge[place] + unseen * c.breaks[place];
            n.known[y][x] = c.noise[place] >= 0 ? 1.0f : 0.0f;
            n.noise[y][x] = std::max(c.noise[place], 0.0f);
        }
    return n;
}

/// Variance of one sample of each pixel, relative to a typical one; 0 if its surroundings are uniform.
PerPixel<double> relative_variances(const Neighbourhood& n, double typical, bool edge_classes) {
    PlanGrid near{}, far{}, noises{}, knowns{};  // folded along the rows, then along the columns
    for (int y = 0; y < kPlanSide; ++y)
        for (int x = kRim; x < kPlanSide - kRim; ++x) {
            const auto row = [&](const PlanGrid& g) { return [&g, x, y](int k) { return g[y][x + k]; }; };
            near[y][x] = fold(1, row(n.edge), kGreatest);
            far[y][x] = fold(2, row(n.edge), kGreatest);
            noises[y][x] = fold(2, row(n.noise), kSum);
            knowns[y][x] = fold(2, row(n.known), kSum);
        }
    PerPixel<double> variances{};
    for (int y = kRim; y < kPlanSide - kRim; ++y)
        for (int x = kRim; x < kPlanSide - kRim; ++x) {
            const auto column = [&](const PlanGrid& g) { return [&g, x, y](int k) { return g[y + k][x]; }; };
            // Excluded below: the noise values that contain the pixel's own centre, those of the pixel and its four
            // neighbours.
            const auto cross = [&](const PlanGrid& g) {
                return g[y][x] + g[y][x - 1] + g[y][x + 1] + g[y - 1][x] + g[y + 1][x];
            };
            float edge = n.edge[y][x];
            if (edge_classes)
                edge = std::max({edge, kVarianceBesideEdge * fold(1, column(near), kGreatest),
                                 kVarianceTwoFromEdge * fold(2, column(far), kGreatest)});
            const float neighbours = fold(2, column(knowns), kSum) - cross(n.known);
            const float noise =
                neighbours > 0 ? std::max(fold(2, column(noises), kSum) - cross(n.noise), 0.0f) / neighbours : 0.0f;
            variances[place_in_tile(x - kRim, y - kRim)] =
                std::pow(static_cast<double>(edge) / typical, kEdgePower) + static_cast<double>(noise) / typical;
        }
    return variances;
}

template <class Do>
void over_tiles(std::span<const std::uint32_t> tiles, Do&& act) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, tiles.size(), kGrain), act, tbb::simple_partitioner());
}

/// Rank of a tile among 8 x 8: Bayer's ordered dither, whose first 4^k ranks are evenly spread.
int rank_of(int tx, int ty) {
    int rank = 0;
    for (int bit = 0; bit < 3; ++bit) {
        const int x = tx >> bit & 1, y = ty >> bit & 1;
        rank = rank << 2 | (x ^ y) << 1 | y;
    }
    return rank;
}

}  // namespace

SamplePlan::SamplePlan(std::size_t tiles) : contrasts_(tiles), weights_(tiles), sums_(tiles), ranks_(tiles) {}

void SamplePlan::make_adaptive(const Frame& f, const GBuffer& g_buffer, std::span<const std::uint32_t> tiles) {
    uniform_ = false;
    over_tiles(tiles, [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) contrast_tile(f, g_buffer, tiles[i]);
    });
    Sums all;
    for (const std::uint32_t tile : tiles) {
        all.variance += sums_[tile].variance;
        all.deviation += sums_[tile].deviation;
    }
    const double typical = all.variance > 0 ? all.variance / all.deviation : 1;
    for (auto& bin : histogram_) bin.store(0, std::memory_order_relaxed);
    over_tiles(tiles, [&](const auto& range) {
        Histogram histogram{};
        for (std::size_t i = range.begin(); i != range.end(); ++i)
            set_weights(f, g_buffer, tiles[i], typical * typical, histogram);
        for (std::size_t w = 0; w < histogram.size(); ++w)
            if (histogram[w] > 0) histogram_[w].fetch_add(histogram[w], std::memory_order_relaxed);
    });
}

void SamplePlan::clear() noexcept {
    for (PerPixel<Weight>& w : weights_) w.fill(-1);
}

void SamplePlan::contrast_tile(const Frame& f, const GBuffer& g_buffer, std::size_t tile) noexcept {
    TileContrast& c = contrasts_[tile];
    g_buffer.contrast(f, tile, c);
    Sums sums;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
        const double variance = static_cast<double>(c.of_sample(i));
        sums.variance += variance;
        sums.deviation += std::sqrt(variance);
    }
    sums_[tile] = sums;
}

void SamplePlan::set_weights(const Frame& f, const GBuffer& g_buffer, std::size_t tile, double typical_variance,
                             Histogram& histogram) noexcept {
    const int tx = static_cast<int>(tile) % g_buffer.tiles_x(), ty = static_cast<int>(tile) / g_buffer.tiles_x();
    const float unseen = kHiddenVariance / 12 * static_cast<float>(typical_variance);
    const PerPixel<double> variances = relative_variances(gather(g_buffer, contrasts_, tx, ty, unseen),
                                                          typical_variance, f.settings.mechanisms.edge_classes);
    for (int y = 0; y < kTile; ++y)
        for (int x = 0; x < kTile; ++x) {
            const std::size_t place = place_in_tile(x, y);
            Weight& out = weights_[tile][place];
            out = -1;
            if (tx * kTile + x >= g_buffer.width() || ty * kTile + y >= g_buffer.height()) continue;
            const double variance = variances[place];
            const double doublings = std::log2(std::max(std::sqrt(variance), kMinWeight) / kMinWeight);
            const int of_variance =
                variance > 0 ? kMinNonUniformWeight + static_cast<int>(kPerDoubling * doublings) : 0;
            const bool empty = g_buffer.tile(tile).surface[place] == 0;
            const int weight =
                std::max(of_variance, empty ? kMinNonUniformWeight + kEmptyDoublings * kPerDoubling : 0);
            const auto hash = static_cast<int>(sampler_detail::mix(tile * kTilePixels + place) % kPerDoubling);
            out = static_cast<Weight>(std::min(weight + hash, kWeights - 1));
            ++histogram[static_cast<std::size_t>(out)];
        }
}

void SamplePlan::make_uniform(const Frame& f, std::span<const std::uint32_t> tiles) {
    const int width = f.camera.width, height = f.camera.height;
    uniform_ = true;
    all_by_paths_ = f.parts != LightParts::both;
    pixels_of_rank_.fill(0);
    const int tiles_x = (width + kTile - 1) / kTile;
    for (const std::uint32_t tile : tiles) {
        const int tx = static_cast<int>(tile) % tiles_x, ty = static_cast<int>(tile) / tiles_x;
        const int columns = std::min(kTile, width - tx * kTile), rows = std::min(kTile, height - ty * kTile);
        ranks_[tile] = static_cast<std::uint8_t>(rank_of(tx, ty));
        pixels_of_rank_[ranks_[tile]] += static_cast<std::uint64_t>(columns * rows);
    }
}

std::uint64_t SamplePlan::total(Stage stage) const noexcept {
    std::uint64_t sum = 0;
    if (uniform_)
        for (int rank = 0; rank < kRanks; ++rank)
            sum += pixels_of_rank_[static_cast<std::size_t>(rank)] * of_rank(rank, stage);
    else
        for (int w = 0; w < kWeights; ++w)
            sum += std::uint64_t{histogram_[static_cast<std::size_t>(w)].load(std::memory_order_relaxed)} *
                   count(static_cast<Weight>(w), stage);
    return sum;
}

std::uint64_t SamplePlan::total_paths(Stage stage) const noexcept {
    if (all_by_paths_) return total(stage);
    std::uint64_t sum = 0;
    for (int rank = 0; rank < kRanks; ++rank)
        sum += pixels_of_rank_[static_cast<std::size_t>(rank)] * paths_of(of_rank(rank, stage));
    return sum;
}

std::uint64_t SamplePlan::total_beyond(std::uint32_t each, Stage stage) const noexcept {
    std::uint64_t sum = 0;
    for (int w = 0; w < kWeights; ++w)
        sum += std::uint64_t{histogram_[static_cast<std::size_t>(w)].load(std::memory_order_relaxed)} *
               (std::max(count(static_cast<Weight>(w), stage), each) - each);
    return sum;
}

SamplePlan::Stage SamplePlan::reach_beyond(std::uint32_t each, double samples) const noexcept {
    int within = -kWeights, beyond = kFull + 1;
    while (within + 1 < beyond) {
        const int middle = within + (beyond - within) / 2;
        (static_cast<double>(total_beyond(each, {middle})) <= samples ? within : beyond) = middle;
    }
    return {within};
}

SamplePlan::Stage SamplePlan::reach(Stage from, double rays, double each_sample, double each_path) const noexcept {
    const auto rays_of = [&](Stage stage) {
        const double paths = uniform_ && each_path > 0 ? static_cast<double>(total_paths(stage)) : 0;
        return each_sample * static_cast<double>(total(stage)) + each_path * paths;
    };
    const double most = rays_of(from) + rays;
    int within = std::max(from.level, uniform_ ? 0 : -kWeights);
    int beyond = uniform_ ? samples_each(kMaxEach).level + 1 : kFull + 1;
    while (within + 1 < beyond) {
        const int middle = within + (beyond - within) / 2;
        (rays_of({middle}) <= most ? within : beyond) = middle;
    }
    return {within};
}

}  // namespace narpa
