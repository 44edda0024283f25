#include "renderer/frame/pixel_fill.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "renderer/frame/tuning.h"
#include "renderer/integrator/sampler.h"

namespace narpa {
namespace {

using namespace tuning;

constexpr std::size_t kFillGrain = 16;  ///< tiles per task
constexpr int kWindowBorder = 2, kWindowSide = kTile + 2 * kWindowBorder;

template <class Do>
void over_filled_tiles(std::span<const std::uint32_t> tiles, Do&& act) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, tiles.size(), kFillGrain),
        [&](const auto& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) act(tiles[i]);
        },
        tbb::simple_partitioner());
}

/// The places of a tile that belong to a lattice.
constexpr std::uint64_t lattice(int stride) {
    std::uint64_t places = 0;
    for (int y = 0; y < kTile; y += stride)
        for (int x = 0; x < kTile; x += stride) places |= std::uint64_t{1} << place_in_tile(x, y);
    return places;
}

/// The two hits lie on one side of a silhouette: on the background, on one surface, or at about one depth.
bool together(std::uint32_t surface_a, float depth_a, std::uint32_t surface_b, float depth_b) {
    if (surface_a == 0 || surface_b == 0) return surface_a == surface_b;
    const bool one_surface = surface_a >> 2 == surface_b >> 2;  // but for sunlight
    const float gap = std::abs(depth_a - depth_b), nearer = std::min(depth_a, depth_b);
    return gap <= (one_surface ? kOneSurfaceGap : kOneSideGap) * nearer;
}

}  // namespace

/// A tile with its surroundings.
struct PixelFill::Window {
    std::array<float, kWindowSide * kWindowSide> radiance{}, depth{};
    std::array<std::uint32_t, kWindowSide * kWindowSide> surface{};
    std::array<bool, kWindowSide * kWindowSide> known{};
    std::array<const GBufferTile*, 9> tiles{};  ///< null: shows the background

    Window(const GBuffer& g, std::uint32_t tile, const std::vector<std::uint64_t>& known_pixels) {
        const int tx = static_cast<int>(tile) % g.tiles_x(), ty = static_cast<int>(tile) / g.tiles_x();
        const float background = mean_band(g.background());
        for (int row = -1; row <= 1; ++row)
            for (int column = -1; column <= 1; ++column) {
                const int x = tx + column, y = ty + row;
                if (x < 0 || y < 0 || x >= g.tiles_x() || y >= g.tiles_y()) continue;
                const auto other = static_cast<std::uint32_t>(y * g.tiles_x() + x);
                const GBufferTile* const t = g.is_traced(other) ? &g.tile(other) : nullptr;
                tiles[static_cast<std::size_t>((row + 1) * 3 + column + 1)] = t;
                const std::uint64_t is_known = t == nullptr ? ~std::uint64_t{0} : known_pixels[other];
                const int x_end = g.width() - x * kTile, y_end = g.height() - y * kTile;
                const auto first = [](int k) { return k < 0 ? kTile - kWindowBorder : 0; };
                const auto end = [](int k, int last) { return std::min(k > 0 ? kWindowBorder : kTile, last); };
                for (int py = first(row); py < end(row, y_end); ++py)
                    for (int px = first(column); px < end(column, x_end); ++px) {
                        const std::size_t at = cell(px + column * kTile, py + row * kTile);
                        const std::size_t place = place_in_tile(px, py);
                        known[at] = (is_known >> place & 1) != 0;
                        if (!known[at]) continue;
                        radiance[at] = t == nullptr ? background : (t->r[place] + t->g[place] + t->b[place]) / 3;
                        surface[at] = t == nullptr ? 0 : t->surface[place];
                        depth[at] = t == nullptr ? 0 : t->depth_m[place];
                    }
            }
    }
    static constexpr std::size_t cell(int x, int y) {
        return static_cast<std::size_t>((y + kWindowBorder) * kWindowSide + x + kWindowBorder);
    }

    /// Known neighbours of a pixel at a distance of `stride` pixels, those beside it first.
    struct Around {
        std::array<std::size_t, 8> at;
        std::array<float, 8> weight;
        std::size_t n = 0;
    };
    [[nodiscard]] Around around(int x, int y, int stride) const {
        constexpr std::array<std::array<int, 2>, 8> kSteps{
            {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}}};
        Around a;
        for (std::size_t i = 0; i < kSteps.size(); ++i) {
            const std::size_t at = cell(x + stride * kSteps[i][0], y + stride * kSteps[i][1]);
            if (!known[at]) continue;
            a.at[a.n] = at;
            a.weight[a.n++] = i < 4 ? 2 : 1;
        }
        return a;
    }
    /// The darkest and the brightest neighbour.
    [[nodiscard]] std::pair<float, float> range(const Around& a) const {
        float low = radiance[a.at[0]], high = low;
        for (std::size_t i = 1; i < a.n; ++i)
            low = std::min(low, radiance[a.at[i]]), high = std::max(high, radiance[a.at[i]]);
        return {low, high};
    }
    /// True if all neighbours lie on one side: the usual case.
    [[nodiscard]] bool one_side(const Around& a) const {
        const std::uint32_t first = surface[a.at[0]] >> 2;
        float nearest = depth[a.at[0]], farthest = nearest;
        for (std::size_t i = 1; i < a.n; ++i) {
            if (surface[a.at[i]] >> 2 != first) return false;
            nearest = std::min(nearest, depth[a.at[i]]), farthest = std::max(farthest, depth[a.at[i]]);
        }
        return farthest - nearest <= kOneSurfaceGap * nearest;
    }
    /// The neighbours on the side of a silhouette with the largest weight: a bit for each. `hash` decides between
    /// equal ones.
    [[nodiscard]] std::uint32_t side(const Around& a, std::uint64_t hash) const {
        const std::uint32_t all = (1u << a.n) - 1;
        if (one_side(a)) return all;
        std::uint32_t best = 0;
        float most = 0;
        for (std::size_t k = 0; k < a.n; ++k) {
            const std::size_t i = (k + hash) % a.n;
            if ((best >> i & 1) != 0) continue;
            std::uint32_t with = 0;
            float weight = 0;
            for (std::size_t j = 0; j < a.n; ++j)
                if (together(surface[a.at[i]], depth[a.at[i]], surface[a.at[j]], depth[a.at[j]]))
                    with |= 1u << j, weight += a.weight[j];
            if (weight > most) most = weight, best = with;
        }
        return best;
    }
    /// The tile's data of a cell, null for the background, and its place there.
    [[nodiscard]] std::pair<const GBufferTile*, std::size_t> pixel(std::size_t at) const {
        const int x = static_cast<int>(at) % kWindowSide - kWindowBorder,
                  y = static_cast<int>(at) / kWindowSide - kWindowBorder;
        const int column = x < 0 ? -1 : x >= kTile ? 1 : 0, row = y < 0 ? -1 : y >= kTile ? 1 : 0;
        return {tiles[static_cast<std::size_t>((row + 1) * 3 + column + 1)],
                place_in_tile(x - column * kTile, y - row * kTile)};
    }
};

PixelFill::PixelFill(const GBuffer& g_buffer)
    : width_(g_buffer.width()),
      height_(g_buffer.height()),
      tiles_x_(g_buffer.tiles_x()),
      traced_(g_buffer.tiles()),
      known_(g_buffer.tiles()),
      changed_(g_buffer.tiles()),
      level_(g_buffer.tiles()),
      guess_(g_buffer.tiles()) {}

void PixelFill::begin(std::span<const std::uint32_t> tiles) noexcept {
    for (const std::uint32_t tile : tiles) traced_[tile] = 0;
    compared_ = compared_coarser_ = {};
}

namespace {

std::uint64_t hash_of(std::uint32_t tile, std::size_t place) {
    return sampler_detail::mix(tile * kTilePixels + place) >> 32;
}

/// The places of a tile within the image.
std::uint64_t within(int width, int height, std::uint32_t tile, int tiles_x) {
    const int x_end = width - static_cast<int>(tile) % tiles_x * kTile;
    const int y_end = height - static_cast<int>(tile) / tiles_x * kTile;
    if (x_end >= kTile && y_end >= kTile) return ~std::uint64_t{0};
    std::uint64_t places = 0;
    for (int y = 0; y < std::min(kTile, y_end); ++y)
        for (int x = 0; x < std::min(kTile, x_end); ++x) places |= std::uint64_t{1} << place_in_tile(x, y);
    return places;
}

template <class Do>
void each_place(std::uint64_t places, Do&& act) {
    for (; places != 0; places &= places - 1) act(static_cast<std::size_t>(std::countr_zero(places)));
}

constexpr int x_of(std::size_t place) {
    return static_cast<int>(place >> 4 & 1) * 4 + static_cast<int>(place & 3);
}
constexpr int y_of(std::size_t place) {
    return static_cast<int>(place >> 5) * 4 + static_cast<int>(place >> 2 & 3);
}

}  // namespace

void PixelFill::guess_tile(const GBuffer& g_buffer, std::uint32_t tile, int stride) noexcept {
    const std::uint64_t planned = lattice(stride) & ~traced_[tile] & within(width_, height_, tile, tiles_x_);
    PerPixel<Guess>& guess = guess_[tile];
    if (planned == 0) return;
    if (stride == 4 || g_buffer.in_empty_space(tile)) {
        const float background = mean_band(g_buffer.background());
        return each_place(planned, [&](std::size_t place) { guess[place] = {background, 0, false}; });
    }
    const Window w(g_buffer, tile, traced_);
    each_place(planned, [&](std::size_t place) {
        const Window::Around a = w.around(x_of(place), y_of(place), stride);
        const std::uint32_t side = w.side(a, hash_of(tile, place));
        const auto [low, high] = w.range(a);
        float sum = 0, weight = 0;
        for (std::size_t i = 0; i < a.n; ++i)
            if ((side >> i & 1) != 0) sum += a.weight[i] * w.radiance[a.at[i]], weight += a.weight[i];
        const bool silhouette = side != (1u << a.n) - 1;
        guess[place] = {sum / weight, high - low, silhouette};
    });
}

float PixelFill::contrast_of(const Guess& guess) const noexcept {
    return guess.silhouette ? std::max(guess.contrast, kSilhouetteContrast * most_) : guess.contrast;
}

int PixelFill::octave_of(float contrast) const noexcept {
    if (contrast <= 0) return kOctaves - 1;
    return std::clamp(static_cast<int>(std::log2(most_ / contrast)), 0, kOctaves - 1);
}

int PixelFill::level_of(std::uint32_t tile, std::size_t place) const noexcept {
    const float contrast = contrast_of(guess_[tile][place]);
    if (contrast < 0) return 0;
    const std::uint64_t hash = hash_of(tile, place);
    if (hash % kComparedPart == 0) return 1;
    constexpr int kLast = kLevels - kPerOctave;  // of the lowest octave, in no order
    const int level = contrast > 0 ? static_cast<int>(kPerOctave * std::log2(most_ / contrast)) : kLast;
    if (level >= kLast) return 1 + kLast + static_cast<int>(hash / kComparedPart % kPerOctave);
    return 1 + std::max(level, 0);
}

void PixelFill::plan(const GBuffer& g_buffer, std::span<const std::uint32_t> tiles, int stride) {
    stride_ = stride;
    compared_coarser_ = compared_;
    compared_ = {};
    over_filled_tiles(tiles, [&](std::uint32_t tile) {
        guess_[tile].fill({});
        guess_tile(g_buffer, tile, stride);
    });
    if (stride == 2) {
        most_ = tbb::parallel_reduce(
            tbb::blocked_range<std::size_t>(0, tiles.size(), kFillGrain), 0.0f,
            [&](const auto& range, float most) {
                for (std::size_t i = range.begin(); i != range.end(); ++i)
                    for (const Guess& g : guess_[tiles[i]]) most = std::max(most, g.contrast);
                return most;
            },
            [](float a, float b) { return std::max(a, b); });
        if (!(most_ > 0)) most_ = 1;
    }
    using Levels = std::array<std::uint32_t, kLevels + 1>;
    pixels_ = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, tiles.size(), 8 * kFillGrain), Levels{},
        [&](const auto& range, Levels pixels) {
            for (std::size_t i = range.begin(); i != range.end(); ++i)
                for (std::size_t place = 0; place < kTilePixels; ++place) {
                    const int level = level_of(tiles[i], place);
                    level_[tiles[i]][place] = static_cast<std::int16_t>(level);
                    ++pixels[static_cast<std::size_t>(level)];
                }
            return pixels;
        },
        [](Levels a, const Levels& b) {
            for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
            return a;
        });
}

std::uint64_t PixelFill::total(Stage stage) const noexcept {
    std::uint64_t sum = 0;
    for (int level = 1; level <= stage.level; ++level) sum += pixels_[static_cast<std::size_t>(level)];
    return sum;
}

PixelFill::Stage PixelFill::reach(Stage from, double pixels) const noexcept {
    Stage to = from;
    for (std::uint64_t sum = 0; to.level < kLevels; ++to.level) {
        sum += pixels_[static_cast<std::size_t>(to.level) + 1];
        if (static_cast<double>(sum) > pixels) break;
    }
    return to;
}

std::uint64_t PixelFill::between(std::uint32_t tile, Stage from, Stage to) const noexcept {
    std::uint64_t places = 0;
    for (std::size_t place = 0; place < kTilePixels; ++place) {
        const int level = level_[tile][place];
        if (level > from.level && level <= to.level) places |= std::uint64_t{1} << place;
    }
    return places;
}

void PixelFill::take(const GBuffer& g_buffer, std::span<const std::uint32_t> tiles, Stage from, Stage to) {
    const auto add = [](Comparisons a, const Comparisons& b) {
        for (std::size_t i = 0; i < a.size(); ++i) {
            a[i].squares += b[i].squares, a[i].contrasts += b[i].contrasts, a[i].pixels += b[i].pixels;
        }
        return a;
    };
    const Comparisons more = tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, tiles.size(), kFillGrain), Comparisons{},
        [&](const auto& range, Comparisons sums) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
                const GBufferTile& t = g_buffer.tile(tiles[i]);
                const std::uint64_t taken = between(tiles[i], from, to);
                traced_[tiles[i]] |= taken;
                if (stride_ == 4) continue;
                each_place(taken, [&](std::size_t place) {
                    const Guess& guess = guess_[tiles[i]][place];
                    Comparison& c = sums[static_cast<std::size_t>(octave_of(contrast_of(guess)))];
                    const double off =
                        static_cast<double>((t.r[place] + t.g[place] + t.b[place]) / 3) - guess.radiance;
                    const auto contrast = static_cast<double>(contrast_of(guess));
                    c.squares += off * off, c.contrasts += contrast * contrast, c.pixels += 1;
                });
            }
            return sums;
        },
        add);
    compared_ = add(compared_, more);
}

void PixelFill::reconstruct_tile(GBuffer& g_buffer, std::uint32_t tile, int stride) noexcept {
    const std::uint64_t wanted = lattice(stride) & ~known_[tile] & within(width_, height_, tile, tiles_x_);
    if (wanted == 0) return;
    GBufferTile& t = g_buffer.tile(tile);
    /// `like`: the tile and place of a neighbour on the same surface; null: the background.
    const auto put = [&](std::size_t place, const Rgb& radiance, const GBufferTile* like, std::size_t there) {
        t.r[place] = radiance.x, t.g[place] = radiance.y, t.b[place] = radiance.z;
        t.surface[place] = like != nullptr ? like->surface[there] : 0;
        t.nx[place] = like != nullptr ? like->nx[there] : 0;
        t.ny[place] = like != nullptr ? like->ny[there] : 0;
        t.nz[place] = like != nullptr ? like->nz[there] : 0;
        t.depth_m[place] = like != nullptr ? like->depth_m[there] : 0;
        t.reused[place] = like != nullptr ? like->reused[there] : 0;
    };
    if (g_buffer.in_empty_space(tile))
        return each_place(wanted, [&](std::size_t place) {
            put(place, g_buffer.background(), nullptr, 0);
            if (stride < stride_) guess_[tile][place] = {mean_band(g_buffer.background()), 0, false};
        });
    const Window w(g_buffer, tile, known_);
    each_place(wanted, [&](std::size_t place) {
        const Window::Around a = w.around(x_of(place), y_of(place), stride);
        const std::uint32_t side = w.side(a, hash_of(tile, place));
        Rgb sum{};
        float weight = 0;
        if (stride < stride_) {  // no plan has reached the pixel
            const auto [low, high] = w.range(a);
            guess_[tile][place] = {low, high - low, side != (1u << a.n) - 1};
        }
        for (std::uint32_t rest = side; rest != 0; rest &= rest - 1) {
            const auto i = static_cast<std::size_t>(std::countr_zero(rest));
            const auto [of, there] = w.pixel(a.at[i]);
            const Rgb r = of == nullptr ? g_buffer.background() : Rgb{of->r[there], of->g[there], of->b[there]};
            sum += a.weight[i] * r, weight += a.weight[i];
        }
        const auto [like, there] = w.pixel(a.at[static_cast<std::size_t>(std::countr_zero(side))]);
        const Rgb mean = (1 / weight) * sum;
        put(place, mean, like, there);
        if (t.surface[place] != 0 || mean != g_buffer.background()) changed_[tile] = 1;
    });
}

void PixelFill::reconstruct(GBuffer& g_buffer, std::span<const std::uint32_t> tiles) {
    for (const std::uint32_t tile : tiles) known_[tile] = traced_[tile], changed_[tile] = 0;
    for (const int stride : {2, 1}) {
        over_filled_tiles(tiles, [&](std::uint32_t tile) { reconstruct_tile(g_buffer, tile, stride); });
        for (const std::uint32_t tile : tiles) {
            known_[tile] |= lattice(stride);
            if (changed_[tile] != 0) g_buffer.set_something(tile);
        }
    }
}

double PixelFill::error_of(std::uint32_t tile, std::size_t place) const noexcept {
    const float contrast = contrast_of(guess_[tile][place]);
    if (contrast < 0) return mean_square();
    const auto octave = static_cast<std::size_t>(octave_of(contrast));
    const double square = static_cast<double>(contrast) * static_cast<double>(contrast);
    for (const Comparisons* all : {&compared_, &compared_coarser_}) {
        const Comparison& c = (*all)[octave];
        if (c.pixels < kMinComparisons) continue;
        return square > 0 && c.contrasts > 0 ? square * c.squares / c.contrasts : c.squares / c.pixels;
    }
    return kFillErrorOfContrast * square;
}

double PixelFill::mean_square() const noexcept {
    double squares = 0, pixels = 0;
    for (const Comparisons* c : {&compared_coarser_, &compared_})
        for (const Comparison& one : *c) squares += one.squares, pixels += one.pixels;
    return pixels > 0 ? squares / pixels : 0;
}

}  // namespace narpa
