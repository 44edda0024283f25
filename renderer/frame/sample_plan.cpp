#include "renderer/frame/sample_plan.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "base/each_isa.h"
#include "base/fast_math.h"
#include "renderer/frame/culling/tile_window.h"
#include "renderer/frame/tuning.h"
#include "renderer/integrator/sampler.h"

namespace narpa {
namespace {

using namespace tuning;

constexpr std::size_t kGrain = 16;  ///< tiles per task

/// Contrasts of a tile's pixels and their neighbours up to two pixels away.
struct alignas(64) Neighbourhood {
    WindowGrid<float> edge{};            ///< variance
    WindowGrid<float> noise{}, known{};  ///< variance; 1 where it is known

    void put(const TileContrast& c, std::size_t place, float unseen, std::size_t at) {
        edge[at] = c.edge[place] + unseen * c.breaks[place];
        known[at] = c.noise[place] >= 0 ? 1.0f : 0.0f;
        noise[at] = std::max(c.noise[place], 0.0f);
    }
};

Neighbourhood gather(const GBuffer& g_buffer, const std::vector<TileContrast>& contrasts, std::uint32_t tile,
                     float unseen) {
    Neighbourhood n;
    each_pixel_in_window(g_buffer, tile, kWindowBorder,
                         [&](std::uint32_t other, std::size_t place, std::size_t at) {
                             if (g_buffer.is_traced(other)) n.put(contrasts[other], place, unseen, at);
                         });
    return n;
}

/// How much of an edge's variance pixels beside it get, and two pixels away.
struct EdgeClasses {
    float beside = 0, two_away = 0;
};

/// Variance of one sample of each pixel, relative to a typical one; 0 if its surroundings are uniform.
NARPA_EACH_ISA void relative_variances(const Neighbourhood& n, float typical, const EdgeClasses& classes,
                                       WindowGrid<float>& variances) noexcept {
    constexpr std::size_t kDown = kWindowRow, kFirst = 2, kEnd = WindowGrid<float>{}.size() - 2;
    const auto most = [](float a, float b) { return a > b ? a : b; };
    WindowGrid<float> near{}, far{}, noises{}, knowns{}, out{};  // folded along the rows, then along the columns
    for (std::size_t at = kFirst; at < kEnd; ++at) {
        near[at] = most(most(n.edge[at - 1], n.edge[at]), n.edge[at + 1]);
        far[at] = most(most(n.edge[at - 2], near[at]), n.edge[at + 2]);
        noises[at] = n.noise[at - 2] + n.noise[at - 1] + n.noise[at] + n.noise[at + 1] + n.noise[at + 2];
        knowns[at] = n.known[at - 2] + n.known[at - 1] + n.known[at] + n.known[at + 1] + n.known[at + 2];
    }
    const auto sum_down = [](const WindowGrid<float>& g, std::size_t at) {
        return g[at - 2 * kDown] + g[at - kDown] + g[at] + g[at + kDown] + g[at + 2 * kDown];
    };
    // Excluded below: the noise values that contain the pixel's own centre, those of the pixel and its four
    // neighbours.
    const auto cross = [](const WindowGrid<float>& g, std::size_t at) {
        return g[at] + g[at - 1] + g[at + 1] + g[at - kDown] + g[at + kDown];
    };
    const float scale = 1 / typical;
    constexpr float kLeast = 1e-30f;
    for (std::size_t at = kFirstCell; at < kEndCell; ++at) {
        const float beside = most(most(near[at - kDown], near[at]), near[at + kDown]);
        const float two_away = most(most(most(far[at - 2 * kDown], far[at - kDown]), far[at]),
                                    most(far[at + kDown], far[at + 2 * kDown]));
        const float edge = most(n.edge[at], most(classes.beside * beside, classes.two_away * two_away));
        const float neighbours = sum_down(knowns, at) - cross(n.known, at);
        const float sum = most(sum_down(noises, at) - cross(n.noise, at), 0);
        const float noise = neighbours > 0 ? sum / most(neighbours, 1) : 0;
        const float of_edge = exp2_of(kEdgePower * log2_of(most(edge * scale, kLeast)));
        out[at] = (edge > 0 ? of_edge : 0) + noise * scale;
    }
    variances = out;
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

SamplePlan::SamplePlan(std::size_t tiles)
    : contrasts_(tiles), weights_(tiles), sums_(tiles), dither_(tiles), ranks_(tiles) {
    for (std::size_t tile = 0; tile < tiles; ++tile)
        for (std::size_t place = 0; place < kTilePixels; ++place)
            dither_[tile][place] =
                static_cast<std::uint8_t>(sampler_detail::mix(tile * kTilePixels + place) % kPerDoubling);
}

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
    any_contrast_ = all.variance > 0;
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
    if (f.thins_paths) {
        // A weight leaves out the noise values that contain the pixel's own centre, but not its edges.
        TileContrast direct;
        g_buffer.contrast_of_direct(f, tile, direct);
        c.edge = direct.edge, c.breaks = direct.breaks;
    }
    Sums sums;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
        const double variance = static_cast<double>(c.of_sample(i));
        sums.variance += variance;
        sums.deviation += std::sqrt(variance);
    }
    sums_[tile] = sums;
}

void SamplePlan::set_weights(const Frame& f, const GBuffer& g_buffer, std::uint32_t tile, double typical_variance,
                             Histogram& histogram) noexcept {
    const int tx = static_cast<int>(tile) % g_buffer.tiles_x(), ty = static_cast<int>(tile) / g_buffer.tiles_x();
    const float typical = std::max(static_cast<float>(typical_variance), 1e-30f);
    const float unseen = kHiddenVariance / 12 * typical;
    EdgeClasses classes;
    if (f.settings.mechanisms.edge_classes) classes = {kVarianceBesideEdge, kVarianceTwoFromEdge};
    WindowGrid<float> variances;
    relative_variances(gather(g_buffer, contrasts_, tile, unseen), typical, classes, variances);
    constexpr int kEmpty = kMinNonUniformWeight + kEmptyDoublings * kPerDoubling;
    const float min_variance = kMinWeight * kMinWeight;
    const PerPixel<std::uint32_t>& surface = g_buffer.tile(tile).surface;
    for (int y = 0; y < kTile; ++y)
        for (int x = 0; x < kTile; ++x) {
            const std::size_t place = place_in_tile(x, y);
            Weight& out = weights_[tile][place];
            out = -1;
            if (tx * kTile + x >= g_buffer.width() || ty * kTile + y >= g_buffer.height()) continue;
            const float variance = variances[window_cell(x, y)];
            const float doublings = 0.5f * log2_of(std::max(variance, min_variance) / min_variance);
            const int of_variance =
                variance > 0 ? kMinNonUniformWeight + static_cast<int>(kPerDoubling * doublings) : 0;
            const int weight = std::max(of_variance, surface[place] == 0 ? kEmpty : 0);
            out = static_cast<Weight>(std::min(weight + dither_[tile][place], kWeights - 1));
            ++histogram[static_cast<std::size_t>(out)];
        }
}

void SamplePlan::make_uniform(const Frame& f, std::span<const std::uint32_t> tiles) {
    const int width = f.camera.width, height = f.camera.height;
    uniform_ = true;
    all_by_paths_ = !f.thins_paths;
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
