#include "renderer/frame/pixel_fill.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "base/each_isa.h"
#include "renderer/frame/culling/tile_window.h"
#include "renderer/frame/tuning.h"
#include "renderer/integrator/sampler.h"

namespace narpa {
namespace {

using namespace tuning;

constexpr std::size_t kFillGrain = 16;  ///< tiles per task

template <class Do>
void over_filled_tiles(std::span<const std::uint32_t> tiles, Do&& act) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, tiles.size(), kFillGrain),
        [&](const auto& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) act(tiles[i]);
        },
        tbb::simple_partitioner());
}

template <class Do>
void each_place(std::uint64_t places, Do&& act) {
    for (; places != 0; places &= places - 1) act(static_cast<std::size_t>(std::countr_zero(places)));
}
constexpr std::uint64_t bit(std::size_t place) {
    return std::uint64_t{1} << place;
}
constexpr int x_of(std::size_t place) {
    return static_cast<int>(place >> 4 & 1) * 4 + static_cast<int>(place & 3);
}
constexpr int y_of(std::size_t place) {
    return static_cast<int>(place >> 5) * 4 + static_cast<int>(place >> 2 & 3);
}

/// The places of a tile that belong to a lattice.
constexpr std::uint64_t lattice(int stride) {
    std::uint64_t places = 0;
    for (int y = 0; y < kTile; y += stride)
        for (int x = 0; x < kTile; x += stride) places |= bit(place_in_tile(x, y));
    return places;
}

constexpr double square_of(float x) {
    return static_cast<double>(x) * static_cast<double>(x);
}
std::uint64_t hash_of(std::uint32_t tile, std::size_t place) {
    return sampler_detail::mix(tile * kTilePixels + place) >> 32;
}

/// The two hits lie on one side of a silhouette: on the background, on one surface, or at about one depth.
bool together(std::uint32_t surface_a, float depth_a, std::uint32_t surface_b, float depth_b) {
    if (surface_a == 0 || surface_b == 0) return surface_a == surface_b;
    const bool one_surface = surface_a >> 2 == surface_b >> 2;  // but for sunlight
    const float gap = std::abs(depth_a - depth_b), nearer = std::min(depth_a, depth_b);
    return gap <= (one_surface ? kOneSurfaceGap : kOneSideGap) * nearer;
}

// A tile with its surroundings.

/// The neighbours of a pixel, those beside it first.
constexpr std::array<std::array<int, 2>, 8> kNeighbours{
    {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}}};
constexpr std::array<float, 8> kNeighbourWeights{2, 2, 2, 2, 1, 1, 1, 1};

struct WindowPlanes {
    WindowGrid<float> r, g, b, depth;
    WindowGrid<std::uint32_t> surface, known;  ///< known: 1 or 0
};
struct alignas(64) Window : WindowPlanes {
    static constexpr std::uint32_t kBackground = ~0u;
    std::array<std::uint32_t, 9> tiles;  ///< kBackground: not traced

    /// `known_pixels`: of each tile, those within the image. The tile's own pixels must not be changed meanwhile,
    /// nor other tiles' known ones.
    Window(const GBuffer& from, std::uint32_t tile, int border, std::span<const std::uint64_t> known_pixels) {
        std::memset(static_cast<WindowPlanes*>(this), 0, sizeof(WindowPlanes));
        tiles.fill(kBackground);
        const int tx = static_cast<int>(tile) % from.tiles_x(), ty = static_cast<int>(tile) / from.tiles_x();
        for (int y = -1; y <= 1; ++y)
            for (int x = -1; x <= 1; ++x) {
                if (tx + x < 0 || ty + y < 0 || tx + x >= from.tiles_x() || ty + y >= from.tiles_y()) continue;
                const auto other = static_cast<std::uint32_t>((ty + y) * from.tiles_x() + tx + x);
                if (from.is_traced(other)) tiles[static_cast<std::size_t>((y + 1) * 3 + x + 1)] = other;
            }
        const GBufferTile& own = from.tile(tile);
        for (int y = 0; y < kTile; ++y)
            for (int x = 0; x < kTile; x += 4) put_own(own, x, y, known_pixels[tile]);
        each_pixel_beside(from, tile, border, [&](std::uint32_t other, std::size_t place, std::size_t at) {
            if (!from.is_traced(other))
                put_background(from.background(), at);
            else if ((known_pixels[other] >> place & 1) != 0)
                put(from.tile(other), place, at);
        });
    }
    void put_background(const Rgb& radiance, std::size_t at) {
        r[at] = radiance.x, g[at] = radiance.y, b[at] = radiance.z;
        known[at] = 1;
    }
    void put(const GBufferTile& t, std::size_t place, std::size_t at) {
        r[at] = t.r[place], g[at] = t.g[place], b[at] = t.b[place];
        depth[at] = t.depth_m[place], surface[at] = t.surface[place];
        known[at] = 1;
    }
    /// Four pixels of a row, from x on.
    void put_own(const GBufferTile& t, int x, int y, std::uint64_t known_places) {
        const std::size_t place = place_in_tile(x, y), at = window_cell(x, y);
        std::copy_n(&t.r[place], 4, &r[at]), std::copy_n(&t.g[place], 4, &g[at]);
        std::copy_n(&t.b[place], 4, &b[at]), std::copy_n(&t.depth_m[place], 4, &depth[at]);
        std::copy_n(&t.surface[place], 4, &surface[at]);
        for (std::size_t i = 0; i < 4; ++i)
            known[at + i] = static_cast<std::uint32_t>(known_places >> (place + i) & 1);
    }
    /// The tile of a cell and its place there.
    [[nodiscard]] std::pair<std::uint32_t, std::size_t> pixel(std::size_t at) const {
        const int x = static_cast<int>(at) % kWindowRow - kWindowBorder,
                  y = static_cast<int>(at) / kWindowRow - kWindowBorder;
        const int column = x < 0 ? -1 : x >= kTile ? 1 : 0, row = y < 0 ? -1 : y >= kTile ? 1 : 0;
        return {tiles[static_cast<std::size_t>((row + 1) * 3 + column + 1)],
                place_in_tile(x - column * kTile, y - row * kTile)};
    }
};

/// What the known neighbours of each pixel show.
struct alignas(64) Surroundings {
    WindowGrid<float> r, g, b;           ///< weighted means
    WindowGrid<float> contrast;          ///< largest difference of mean bands
    WindowGrid<std::uint32_t> one_side;  ///< 1: no silhouette passes between them, as in most pixels
};

template <int kStride>
[[gnu::always_inline]] inline void average_neighbours_at(const Window& w, Surroundings& out) noexcept {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    Surroundings around;
    for (std::size_t at = kFirstCell; at < kEndCell; ++at) {
        float r = 0, g = 0, b = 0, weight = 0, low = kInfinity, high = -kInfinity;
        float nearest = kInfinity, farthest = -kInfinity;
        std::uint32_t least = ~0u, most = 0;
        const auto add = [&](std::size_t other, float part) {
            const bool known = w.known[other] != 0;
            const float counted = known ? part : 0.0f;
            r += counted * w.r[other], g += counted * w.g[other], b += counted * w.b[other], weight += counted;
            const float mean = (w.r[other] + w.g[other] + w.b[other]) / 3, depth = w.depth[other];
            low = std::min(low, known ? mean : kInfinity), high = std::max(high, known ? mean : -kInfinity);
            nearest = std::min(nearest, known ? depth : kInfinity);
            farthest = std::max(farthest, known ? depth : -kInfinity);
            const std::uint32_t surface = w.surface[other] >> 2;
            least = std::min(least, known ? surface : ~0u), most = std::max(most, known ? surface : 0u);
        };
        constexpr std::size_t kRight = kStride, kDown = kStride * kWindowRow;
        add(at - kRight, 2), add(at + kRight, 2), add(at - kDown, 2), add(at + kDown, 2);
        add(at - kDown - kRight, 1), add(at - kDown + kRight, 1), add(at + kDown - kRight, 1);
        add(at + kDown + kRight, 1);
        const float each = 1 / weight;
        around.r[at] = each * r, around.g[at] = each * g, around.b[at] = each * b;
        around.contrast[at] = high - low;
        const bool flat = farthest - nearest <= kOneSurfaceGap * nearest;
        around.one_side[at] = least == most && flat ? 1 : 0;
    }
    out = around;
}
NARPA_EACH_ISA void average_neighbours(const Window& w, int stride, Surroundings& out) noexcept {
    if (stride == 1)
        average_neighbours_at<1>(w, out);
    else
        average_neighbours_at<2>(w, out);
}

/// Known neighbours of a pixel on one side of a silhouette.
struct Side {
    std::uint32_t neighbours = 0;  ///< a bit for each of kNeighbours
    bool all = true;               ///< no silhouette passes between them
};
/// The side with the largest weight; `hash` decides between equal ones.
Side side_of(const Window& w, std::size_t at, int stride, std::uint64_t hash) {
    std::array<std::size_t, 8> cells;
    std::array<std::uint32_t, 8> known;
    std::size_t n = 0;
    for (std::uint32_t k = 0; k < 8; ++k) {
        cells[k] = at + static_cast<std::size_t>(stride * (kNeighbours[k][1] * kWindowRow + kNeighbours[k][0]));
        if (w.known[cells[k]] != 0) known[n++] = k;
    }
    Side best;
    float most = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const std::uint32_t one = known[(i + hash) % n];
        if ((best.neighbours >> one & 1) != 0) continue;
        std::uint32_t with = 0;
        float weight = 0;
        for (std::size_t j = 0; j < n; ++j) {
            const std::size_t a = cells[one], b = cells[known[j]];
            if (together(w.surface[a], w.depth[a], w.surface[b], w.depth[b]))
                with |= 1u << known[j], weight += kNeighbourWeights[known[j]];
        }
        if (weight > most) most = weight, best = {with, std::popcount(with) == static_cast<int>(n)};
    }
    return best;
}
/// Mean of these neighbours.
Rgb mean_of(const Window& w, std::size_t at, int stride, std::uint32_t side) {
    Rgb sum{};
    float weight = 0;
    for (; side != 0; side &= side - 1) {
        const auto k = static_cast<std::size_t>(std::countr_zero(side));
        const std::size_t other =
            at + static_cast<std::size_t>(stride * (kNeighbours[k][1] * kWindowRow + kNeighbours[k][0]));
        sum += kNeighbourWeights[k] * Rgb{w.r[other], w.g[other], w.b[other]}, weight += kNeighbourWeights[k];
    }
    return (1 / weight) * sum;
}
Rgb radiance_at(const Window& w, std::size_t at) {
    return {w.r[at], w.g[at], w.b[at]};
}
/// The first known neighbour, of those of `side`.
std::size_t first_of(const Window& w, std::size_t at, int stride, std::uint32_t side) {
    for (std::size_t k = 0;; ++k) {
        const std::size_t other =
            at + static_cast<std::size_t>(stride * (kNeighbours[k][1] * kWindowRow + kNeighbours[k][0]));
        if ((side >> k & 1) != 0 && w.known[other] != 0) return other;
    }
}

}  // namespace

PixelFill::PixelFill(const GBuffer& g_buffer)
    : width_(g_buffer.width()),
      height_(g_buffer.height()),
      tiles_x_(g_buffer.tiles_x()),
      traced_(g_buffer.tiles()),
      planned_(g_buffer.tiles()),
      known_(g_buffer.tiles()),
      known_at_plan_(g_buffer.tiles()),
      compared_first_(g_buffer.tiles()),
      changed_(g_buffer.tiles()),
      groups_(g_buffer.tiles()),
      guess_(g_buffer.tiles()),
      levels_of_part_(kParts),
      compared_by_part_(kParts) {
    const std::uint64_t one_in = std::clamp<std::uint64_t>(g_buffer.tiles() / kMinComparedTiles, 1, kComparedTiles);
    for (std::uint32_t tile = 0; tile < compared_first_.size(); ++tile) {
        if (hash_of(tile, 0) % one_in != 0) continue;
        for (std::size_t place = 0; place < kTilePixels; ++place)
            if (hash_of(tile, place) / one_in % kComparedPlaces == 0) compared_first_[tile] |= bit(place);
    }
}

void PixelFill::begin(std::span<const std::uint32_t> tiles) noexcept {
    for (const std::uint32_t tile : tiles) traced_[tile] = 0, guess_[tile].known = 0;
    compared_ = compared_coarser_ = {};
    has_contrasts_ = false;
    stride_ = 2;
}

/// Calls `act(part, first, end)` for each part of the tiles.
template <class Do>
void PixelFill::over_parts(std::size_t tiles, Do&& act) {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, kParts, 1),
        [&](const auto& range) {
            for (std::size_t part = range.begin(); part != range.end(); ++part)
                act(part, part * tiles / kParts, (part + 1) * tiles / kParts);
        },
        tbb::simple_partitioner());
}

/// The places of a tile within the image.
std::uint64_t PixelFill::within(std::uint32_t tile) const noexcept {
    const int x_end = width_ - static_cast<int>(tile) % tiles_x_ * kTile;
    const int y_end = height_ - static_cast<int>(tile) / tiles_x_ * kTile;
    if (x_end >= kTile && y_end >= kTile) return ~std::uint64_t{0};
    std::uint64_t places = 0;
    for (int y = 0; y < std::min(kTile, y_end); ++y)
        for (int x = 0; x < std::min(kTile, x_end); ++x) places |= bit(place_in_tile(x, y));
    return places;
}

/// Gives these pixels the values of their known neighbours at a distance of `stride`, and those to be guessed the
/// contrast and the mean of these.
void PixelFill::reconstruct_tile(GBuffer& g_buffer, std::uint32_t tile, int stride, const Known& known,
                                 std::uint64_t places, std::uint64_t to_guess) noexcept {
    if (places == 0) return;
    GBufferTile& t = g_buffer.tile(tile);
    Guess& guess = guess_[tile];
    guess.known |= to_guess;
    guess.silhouettes &= ~to_guess;
    const Rgb background = g_buffer.background();
    const auto put_background = [&](std::size_t place) { g_buffer.put_background(tile, place); };
    if (g_buffer.in_empty_space(tile)) {
        each_place(places, put_background);
        return each_place(to_guess, [&](std::size_t place) {
            guess.radiance[place] = mean_band(background), guess.contrast[place] = 0;
        });
    }
    const Window w(g_buffer, tile, stride, known);
    Surroundings around;
    average_neighbours(w, stride, around);
    each_place(places, [&](std::size_t place) {
        const std::size_t at = window_cell(x_of(place), y_of(place));
        const bool one_side = around.one_side[at] != 0;
        const Side side = one_side ? Side{~0u, true} : side_of(w, at, stride, hash_of(tile, place));
        const Rgb mean =
            one_side ? Rgb{around.r[at], around.g[at], around.b[at]} : mean_of(w, at, stride, side.neighbours);
        const std::size_t first = first_of(w, at, stride, side.neighbours);
        if (const auto [like, there] = w.pixel(first); like != Window::kBackground)
            g_buffer.put_like(tile, place, like, there);
        else
            put_background(place);
        // Exactly the background among nothing else, as in empty space.
        if (t.surface[place] != 0 || around.contrast[at] != 0 || radiance_at(w, first) != background)
            t.r[place] = mean.x, t.g[place] = mean.y, t.b[place] = mean.z;
        else
            put_background(place);
        if (t.surface[place] != 0 || mean != background) changed_[tile] = 1;
        if ((to_guess >> place & 1) == 0) return;
        guess.radiance[place] = mean_band(mean), guess.contrast[place] = around.contrast[at];
        if (!side.all) guess.silhouettes |= bit(place);
    });
}

void PixelFill::show_changes(GBuffer& g_buffer, std::span<const std::uint32_t> tiles) noexcept {
    for (const std::uint32_t tile : tiles)
        if (changed_[tile] != 0) g_buffer.set_something(tile);
}

float PixelFill::contrast_of(const Guess& guess, std::size_t place) const noexcept {
    const float contrast = guess.contrast[place];
    return (guess.silhouettes >> place & 1) != 0 ? std::max(contrast, kSilhouetteContrast * most_) : contrast;
}

/// The logarithm is linear within an octave: that is enough for an order.
int PixelFill::order_of(float contrast, int per_octave) const noexcept {
    constexpr int kOne = std::bit_cast<int>(1.0f), kOctave = 1 << 23;
    const int below = kOne - std::bit_cast<int>(std::max(contrast, 0.0f) / most_);
    return std::clamp(below / (kOctave / per_octave), 0, kOctaves * per_octave - 1);
}

void PixelFill::Groups::add(std::uint64_t of, int from) noexcept {
    assert(n < places.size() && from <= kLevels);
    places[n] = of, level[n++] = static_cast<std::int16_t>(from);
}

/// Divides the planned pixels of a tile into groups: those that come first whatever their contrast, then the others
/// by contrast.
void PixelFill::group(std::uint32_t tile) noexcept {
    Groups& groups = groups_[tile];
    groups.n = 0;
    const std::uint64_t planned = planned_[tile];
    if (planned == 0) return;
    if (!has_contrasts_) return groups.add(planned, 1 + static_cast<int>(hash_of(tile, 1) % kFirstLevels));
    const std::uint64_t compared = planned & compared_first_[tile];
    if (compared != 0) groups.add(compared, 1 + static_cast<int>(hash_of(tile, 1) % kFirstLevels));
    const Guess& guess = guess_[tile];
    std::array<std::uint64_t, kTilePixels> by_contrast;  // contrast, then place
    std::size_t n = 0;
    float most = 0;
    each_place(planned & ~compared, [&](std::size_t place) {
        const float contrast = contrast_of(guess, place);
        most = std::max(most, contrast);
        by_contrast[n++] = std::uint64_t{std::bit_cast<std::uint32_t>(contrast)} << 32 | place;
    });
    const auto first = by_contrast.begin(), end = first + static_cast<std::ptrdiff_t>(n);
    for (auto from = first; from != end;) {
        const auto to = end - from > static_cast<std::ptrdiff_t>(kLanes) ? from + kLanes : end;
        if (most > 0 && to != end) std::nth_element(from, to, end, std::greater<>());
        std::uint64_t places = 0;
        double squares = 0;
        for (; from != to; ++from) {
            places |= bit(static_cast<std::size_t>(*from & 0xff));
            squares += square_of(std::bit_cast<float>(static_cast<std::uint32_t>(*from >> 32)));
        }
        constexpr int kLast = (kOctaves - 1) * kPerOctave;  // of the lowest octave, in no order
        const int order = order_of(static_cast<float>(std::sqrt(squares / std::popcount(places))), kPerOctave);
        groups.add(places, 1 + kFirstLevels +
                               (order < kLast ? order : kLast + static_cast<int>(hash_of(tile, 0) % kPerOctave)));
    }
}

void PixelFill::plan(GBuffer& g_buffer, std::span<const std::uint32_t> tiles, int stride, bool first) {
    stride_ = stride;
    overwritten_ = false;
    compared_coarser_ = compared_;
    compared_ = {};
    std::array<float, kParts> most{};
    for (const std::uint32_t tile : tiles) {
        const std::uint64_t coarser = first ? 0 : lattice(2 * stride) & within(tile);
        guess_[tile].known &= coarser & ~traced_[tile];
        known_at_plan_[tile] = traced_[tile] | coarser;
        planned_[tile] = lattice(stride) & ~known_at_plan_[tile] & within(tile);
        changed_[tile] = 0;
    }
    if (!first) {
        over_parts(tiles.size(), [&](std::size_t part, std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                const std::uint32_t tile = tiles[i];
                reconstruct_tile(g_buffer, tile, stride, known_at_plan_, planned_[tile], planned_[tile]);
                each_place(planned_[tile], [&](std::size_t place) {
                    most[part] = std::max(most[part], guess_[tile].contrast[place]);
                });
            }
        });
        show_changes(g_buffer, tiles);
        if (!has_contrasts_) most_ = *std::max_element(most.begin(), most.end());
        if (!(most_ > 0)) most_ = 1;
        has_contrasts_ = true;
    }
    over_parts(tiles.size(), [&](std::size_t part, std::size_t begin, std::size_t end) {
        Levels& levels = levels_of_part_[part];
        levels.fill(0);
        for (std::size_t i = begin; i < end; ++i) {
            group(tiles[i]);
            const Groups& groups = groups_[tiles[i]];
            for (std::size_t k = 0; k < groups.n; ++k)
                levels[static_cast<std::size_t>(groups.level[k])] +=
                    static_cast<std::uint32_t>(std::popcount(groups.places[k]));
        }
    });
    pixels_.fill(0);
    for (const Levels& levels : levels_of_part_)
        for (std::size_t i = 0; i < levels.size(); ++i) pixels_[i] += levels[i];
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
    const Groups& groups = groups_[tile];
    for (std::size_t k = 0; k < groups.n; ++k)
        if (groups.level[k] > from.level && groups.level[k] <= to.level) places |= groups.places[k];
    return places;
}

void PixelFill::take(const GBuffer& g_buffer, std::span<const std::uint32_t> tiles, Stage from, Stage to) {
    over_parts(tiles.size(), [&](std::size_t part, std::size_t begin, std::size_t end) {
        Compared& sums = compared_by_part_[part];
        sums = {};
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t tile = tiles[i];
            const GBufferTile& t = g_buffer.tile(tile);
            const Guess& guess = guess_[tile];
            const std::uint64_t taken = between(tile, from, to);
            traced_[tile] |= taken;
            each_place(taken & guess.known, [&](std::size_t place) {
                const float contrast = contrast_of(guess, place);
                const float off = (t.r[place] + t.g[place] + t.b[place]) / 3 - guess.radiance[place];
                Comparisons& which = (compared_first_[tile] >> place & 1) != 0 ? sums.first : sums.others;
                which[static_cast<std::size_t>(octave_of(contrast))] +=
                    Comparison{square_of(off), square_of(contrast), 1};
            });
        }
    });
    for (const Compared& sums : compared_by_part_)
        for (std::size_t i = 0; i < kOctaves; ++i) {
            compared_.first[i] += sums.first[i];
            compared_.others[i] += sums.others[i];
        }
}

/// Where nothing was traced since the last plan, the pixels are reconstructed already.
void PixelFill::reconstruct(GBuffer& g_buffer, std::span<const std::uint32_t> tiles) {
    for (const std::uint32_t tile : tiles)
        known_[tile] = traced_[tile] | (has_contrasts_ ? known_at_plan_[tile] : 0), changed_[tile] = 0;
    for (int stride = has_contrasts_ ? stride_ : stride_ / 2; stride >= 1; stride /= 2) {
        over_filled_tiles(tiles, [&](std::uint32_t tile) {
            const std::uint64_t missing = lattice(stride) & ~known_[tile] & within(tile);
            const bool as_planned = stride == stride_ && missing == planned_[tile];
            if (as_planned && !overwritten_) return;
            reconstruct_tile(g_buffer, tile, stride, as_planned ? known_at_plan_ : known_, missing,
                             missing & ~guess_[tile].known);
        });
        for (const std::uint32_t tile : tiles) known_[tile] |= lattice(stride) & within(tile);
        show_changes(g_buffer, tiles);
    }
    find_errors();
}

/// From the pixels that were traced whatever their contrast, if they are enough: the others lie where contrasts are
/// large, and differ more from their neighbours than pixels of equal contrast elsewhere.
void PixelFill::find_errors() noexcept {
    for (std::size_t octave = 0; octave < kOctaves; ++octave) {
        Comparison with_others = compared_.first[octave];
        with_others += compared_.others[octave];
        Comparison coarser = compared_coarser_.first[octave];
        coarser += compared_coarser_.others[octave];
        OctaveError& error = errors_[octave];
        error = {kFillErrorOfContrast, 0};
        for (const Comparison& c : {compared_.first[octave], with_others, coarser}) {
            if (c.pixels < kMinComparisons) continue;
            // The last octave has all contrasts down to 0: what few of them show does not scale with the others'.
            error = octave + 1 < kOctaves && c.contrasts > 0 ? OctaveError{c.squares / c.contrasts, 0}
                                                             : OctaveError{0, c.squares / c.pixels};
            break;
        }
    }
}

double PixelFill::error_of(std::uint32_t tile, std::size_t place) const noexcept {
    const Guess& guess = guess_[tile];
    if ((guess.known >> place & 1) == 0) return mean_square();
    const float contrast = contrast_of(guess, place);
    const OctaveError& error = errors_[static_cast<std::size_t>(octave_of(contrast))];
    return error.of_square * square_of(contrast) + error.constant;
}

double PixelFill::mean_square() const noexcept {
    Comparison sum;
    for (const Compared* c : {&compared_coarser_, &compared_})
        for (std::size_t i = 0; i < kOctaves; ++i) sum += c->first[i], sum += c->others[i];
    return sum.pixels > 0 ? sum.squares / sum.pixels : 0;
}

}  // namespace narpa
