#include "renderer/frame/g_buffer.h"

#include <algorithm>
#include <cmath>

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr int kSide = kTile + 2;  // with a border of one neighbour
constexpr int kRow = 16;          // row stride, padded to the width of a vector

/// Two pixels show one surface if their normals are less than 6 degrees apart and the line between them less than
/// 12 degrees off the tangent plane.
constexpr float kSameNormal = 0.9945f;
constexpr float kOffPlane2 = 0.0432f;  // squared sine

constexpr float kMaxContrast = 2e9f;  // W m^-2 sr^-1

/// Weights of the squared contrast of a detail that one centre meets, integrated over all scales (g_buffer.h).
constexpr float kDetailInCentres = 0.230f, kDetailInSamples = 0.200f;

/// Row by row.
template <class T>
using Grid = std::array<T, kSide * kRow>;

/// Comparisons of each pixel with the next, to the right or below.
struct Pairs {
    Grid<float> difference, edge;  // edge: 1 or 0
};

}  // namespace

struct alignas(64) GBuffer::Around {
    Grid<float> radiance{}, nx{}, ny{}, nz{}, depth{};
    Grid<std::uint32_t> surface{};
    /// Pinhole only: the point of a pixel's ray at depth 1 m is ahead + x * right + y * down, world axes.
    Vec3f ahead, right, down;
    const Frame* frame = nullptr;          ///< set for any other camera model
    int x_first, y_first, x_last, y_last;  ///< pixel at the border's corner; last pixel of the image
};

GBuffer::GBuffer(int width, int height)
    : width_(width),
      height_(height),
      tiles_x_((width + kTile - 1) / kTile),
      tiles_y_((height + kTile - 1) / kTile),
      tiles_(static_cast<std::size_t>(tiles_x_) * static_cast<std::size_t>(tiles_y_)),
      known_(tiles_.size(), Known::nothing) {}

void GBuffer::begin_frame(const Rgb& background, LightParts parts) {
    background_ = background;
    parts_ = parts;
    if (parts == LightParts::both && direct_.empty()) direct_.resize(tiles_.size());
    std::fill(known_.begin(), known_.end(), Known::nothing);
}

namespace {

/// Surface data of a batch, lane by lane.
struct alignas(64) LaneSurfaces {
    Lanes<float> nx, ny, nz, depth_m;
    Lanes<std::uint32_t> surface;
};

NARPA_EACH_ISA void store_surfaces(const TracedRays& p, const Vec3& axis, std::uint32_t lit,
                                   LaneSurfaces& out) noexcept {
    const Lanes<int> shone = masks_of(lit), met = masks_of(p.hits.met);
    LaneSurfaces seen;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool is = met[i] != 0;
        const auto body = static_cast<std::uint32_t>(p.hits.body[i] + 1);
        const auto material = static_cast<std::uint32_t>(p.hits.material[i]);
        const std::uint32_t surface = ((body * 0x9e3779b1u) ^ (material * 0x85ebca6bu)) << 2 | 2u |
                                      (static_cast<std::uint32_t>(shone[i]) & 1u);
        seen.surface[i] = is ? surface : 0;
        const Vec3 n = p.hits.shading_normal[i];
        seen.nx[i] = is ? static_cast<float>(n.x) : 0;
        seen.ny[i] = is ? static_cast<float>(n.y) : 0;
        seen.nz[i] = is ? static_cast<float>(n.z) : 0;
        seen.depth_m[i] = is ? static_cast<float>(p.hits.range_m[i] * dot(p.rays.direction[i], axis)) : 0;
    }
    out = seen;
}

void store_surfaces(const Frame& f, const TracedRays& p, LaneSurfaces& out) noexcept {
    store_surfaces(p, f.T_world_camera.q * Vec3{0, 0, 1}, f.parts == LightParts::direct ? p.lit : 0, out);
}

}  // namespace

bool GBuffer::shows_background(const Frame& f, const TracedRays& p, const BatchRadiance& light) const noexcept {
    if (p.hits.met != 0) return false;
    for (std::size_t i = 0; i < p.rays.n; ++i)
        if (light.total(f.parts, i) != background_) return false;
    return true;
}

void GBuffer::store(const Frame& f, const TracedRays& p, const BatchRadiance& light,
                    const Lanes<std::uint8_t>& place, std::size_t tile_index) noexcept {
    GBufferTile& tile = tiles_[tile_index];
    if (!shows_background(f, p, light)) known_[tile_index] = Known::something;
    LaneSurfaces seen{};
    if (p.hits.met != 0) store_surfaces(f, p, seen);
    const auto put = [&](const auto& from, auto& to) { put_in_tile(from, place, p.rays.n, to); };
    put_in_tile(f, light, place, p.rays.n, tile.r, tile.g, tile.b);
    put(seen.nx, tile.nx), put(seen.ny, tile.ny), put(seen.nz, tile.nz);
    put(seen.depth_m, tile.depth_m), put(seen.surface, tile.surface);
    if (f.parts != LightParts::direct) put(p.variance, tile.reused);
    if (f.parts != LightParts::both) return;
    for (std::size_t i = 0; i < p.rays.n; ++i) direct_[tile_index][place[i]] = mean_band(light.direct[i]);
}

void GBuffer::store(const Frame& f, const TracedRays& p, const BatchRadiance& light,
                    const Lanes<std::uint8_t>& place, const Lanes<std::uint32_t>& tile) noexcept {
    LaneSurfaces seen{};
    if (p.hits.met != 0) store_surfaces(f, p, seen);
    assert(f.parts == LightParts::direct);
    for (std::size_t i = 0; i < p.rays.n; ++i) {
        GBufferTile& t = tiles_[tile[i]];
        const std::size_t at = place[i];
        const Rgb radiance = light.total(f.parts, i);
        t.r[at] = radiance.x, t.g[at] = radiance.y, t.b[at] = radiance.z;
        t.nx[at] = seen.nx[i], t.ny[at] = seen.ny[i], t.nz[at] = seen.nz[i];
        t.depth_m[at] = seen.depth_m[i], t.surface[at] = seen.surface[i];
        if (seen.surface[i] != 0 || radiance != background_) known_[tile[i]] = Known::something;
    }
}

namespace {

/// `n` pixels of a tile, from `place` on.
template <std::size_t n, class Around, class Radiance>
void copy_pixels(const GBufferTile& t, const Radiance& radiance, std::size_t place, Around& a, std::size_t at) {
    for (std::size_t i = 0; i < n; ++i) a.radiance[at + i] = radiance(place + i);
    std::copy_n(&t.nx[place], n, &a.nx[at]);
    std::copy_n(&t.ny[place], n, &a.ny[at]);
    std::copy_n(&t.nz[place], n, &a.nz[at]);
    std::copy_n(&t.depth_m[place], n, &a.depth[at]);
    std::copy_n(&t.surface[place], n, &a.surface[at]);
}
template <class Around>
void repeat(Around& a, std::size_t from, std::size_t at) {
    for (Grid<float>* grid : {&a.radiance, &a.nx, &a.ny, &a.nz, &a.depth}) (*grid)[at] = (*grid)[from];
    a.surface[at] = a.surface[from];
}

/// Row -1 is the border above the tile, column -1 the border on its left.
constexpr std::size_t cell(int row, int column) {
    return static_cast<std::size_t>((row + 1) * kRow + column + 1);
}

}  // namespace

/// `radiance(tile, place)`: a mean band. Beyond the image its border pixels are repeated, which gives no edge. The
/// corners of the border are not used.
template <class Radiance>
void GBuffer::gather(const Frame& f, std::size_t tile, const Radiance& radiance, Around& a) const noexcept {
    const int tx = static_cast<int>(tile) % tiles_x_, ty = static_cast<int>(tile) / tiles_x_;
    if (const Pinhole* pinhole = f.model->pinhole()) {
        const auto [origin, per_x, per_y] = pinhole->rays(f.T_world_camera.q);
        a.ahead = vec_cast<float>(origin), a.right = vec_cast<float>(per_x), a.down = vec_cast<float>(per_y);
    } else {
        a.frame = &f;
    }
    a.x_first = tx * kTile - 1, a.y_first = ty * kTile - 1;
    a.x_last = width_ - 1, a.y_last = height_ - 1;
    const int columns = std::min(kTile, width_ - tx * kTile), rows = std::min(kTile, height_ - ty * kTile);
    const GBufferTile& own = tiles_[tile];
    const float background = mean_band(background_);
    const auto of = [&](std::size_t t) { return [&radiance, t](std::size_t place) { return radiance(t, place); }; };
    for (int row = 0; row < kTile; ++row) {
        copy_pixels<4>(own, of(tile), place_in_tile(0, row), a, cell(row, 0));
        copy_pixels<4>(own, of(tile), place_in_tile(4, row), a, cell(row, 4));
    }
    const auto pixel_of = [&](std::size_t other, int x, int y, std::size_t at) {
        if (is_traced(other))
            copy_pixels<1>(tiles_[other], of(other), place_in_tile(x, y), a, at);
        else
            a.radiance[at] = background;
    };
    const auto row_of_tiles = static_cast<std::size_t>(tiles_x_);
    for (int row = 0; row < rows; ++row) {
        if (tx > 0)
            pixel_of(tile - 1, kTile - 1, row, cell(row, -1));
        else
            repeat(a, cell(row, 0), cell(row, -1));
        if (tx + 1 < tiles_x_)
            pixel_of(tile + 1, 0, row, cell(row, columns));
        else
            repeat(a, cell(row, columns - 1), cell(row, columns));
    }
    for (int column = 0; column < columns; ++column) {
        if (ty > 0)
            pixel_of(tile - row_of_tiles, column, kTile - 1, cell(-1, column));
        else
            repeat(a, cell(0, column), cell(-1, column));
        if (ty + 1 < tiles_y_)
            pixel_of(tile + row_of_tiles, column, 0, cell(rows, column));
        else
            repeat(a, cell(rows - 1, column), cell(rows, column));
    }
}

namespace {

/// Positions of the pixels' surfaces relative to the camera, world axes.
struct Positions {
    Grid<float> x, y, z;
};
/// With the camera's own model. Rays perpendicular to the camera's axis have no depth, so their pixels never count
/// as the same surface.
template <class Around>
[[gnu::noinline]] void locate_by_model(const Around& a, Positions& p) {
    static_assert(kRow == kLanes);
    const Vec3 axis = a.frame->T_world_camera.q * Vec3{0, 0, 1};
    Lanes<double> x, y;
    Vec3Lanes direction;
    for (int row = 0; row < kSide; ++row) {
        for (int column = 0; column < kRow; ++column)
            x[static_cast<std::size_t>(column)] = std::clamp(a.x_first + column, 0, a.x_last);
        y.fill(std::clamp(a.y_first + row, 0, a.y_last));
        a.frame->model->directions(a.frame->T_world_camera.q, x, y, direction);
        for (std::size_t column = 0; column < kLanes; ++column) {
            const auto at = static_cast<std::size_t>(row) * kRow + column;
            const Vec3 d = direction[column];
            const Vec3f position = vec_cast<float>((static_cast<double>(a.depth[at]) / dot(d, axis)) * d);
            p.x[at] = position.x, p.y[at] = position.y, p.z[at] = position.z;
        }
    }
}
template <class Around>
[[gnu::always_inline]] inline void locate(const Around& a, Positions& p) {
    if (a.frame != nullptr) return locate_by_model(a, p);
    for (int row = 0; row < kSide; ++row)
        for (int column = 0; column < kRow; ++column) {
            const auto at = static_cast<std::size_t>(row * kRow + column);
            const auto x = static_cast<float>(std::clamp(a.x_first + column, 0, a.x_last));
            const auto y = static_cast<float>(std::clamp(a.y_first + row, 0, a.y_last));
            p.x[at] = (a.ahead.x + x * a.right.x + y * a.down.x) * a.depth[at];
            p.y[at] = (a.ahead.y + x * a.right.y + y * a.down.y) * a.depth[at];
            p.z[at] = (a.ahead.z + x * a.right.z + y * a.down.z) * a.depth[at];
        }
}

/// Compares each pixel with the one `step` further on, in all rows but the last.
template <class Around>
[[gnu::always_inline]] inline void compare(const Around& a, const Positions& p, std::size_t step, Pairs& pairs) {
    for (std::size_t at = 0; at < (kSide - 1) * kRow; ++at) {
        const std::size_t next = at + step;
        const float turn = a.nx[at] * a.nx[next] + a.ny[at] * a.ny[next] + a.nz[at] * a.nz[next];
        const float dx = p.x[next] - p.x[at], dy = p.y[next] - p.y[at], dz = p.z[next] - p.z[at];
        const float off = a.nx[at] * dx + a.ny[at] * dy + a.nz[at] * dz;
        // Clamped so that its fourth power is finite; the Sun's disc is 70 times fainter than the limit.
        const float d = std::min(std::max(a.radiance[next] - a.radiance[at], -kMaxContrast), kMaxContrast);
        const bool steady = (turn > kSameNormal) & (off * off <= kOffPlane2 * (dx * dx + dy * dy + dz * dz));
        const bool empty = a.surface[at] == 0, even = d == 0;
        const bool same = (a.surface[at] == a.surface[next]) & ((empty & even) | (!empty & steady));
        pairs.difference[at] = d;
        pairs.edge[at] = same ? 0.0f : 1.0f;
    }
}

/// Sums over the two pairs of a pixel along one axis.
struct AlongAxis {
    float edges, slopes;  ///< squared contrasts
    float detail;         ///< squared contrast of a peak or a dip between two edges
    float breaks;         ///< number of edges
    float bend, known;    ///< squared second difference; 1 if it is valid
};

[[gnu::always_inline]] inline AlongAxis along_axis(const Pairs& p, std::size_t at, std::size_t step) {
    const float before = p.difference[at - step], after = p.difference[at];
    const float edge_before = p.edge[at - step], edge_after = p.edge[at];
    const float known = (1 - edge_before) * (1 - edge_after), bend = after - before;
    return {edge_before * before * before + edge_after * after * after,
            (1 - edge_before) * before * before + (1 - edge_after) * after * after,
            edge_before * edge_after * std::max(0.0f, -before * after),
            edge_before + edge_after,
            known * bend * bend,
            known};
}

NARPA_EACH_ISA void measure_contrasts(const GBuffer::Around& a, TileContrast& out) noexcept {
    Positions positions;
    Pairs across, down;
    locate(a, positions);
    compare(a, positions, 1, across);
    compare(a, positions, kRow, down);
    Grid<float> breaks, edge, noise, centre;
    for (std::size_t at = kRow; at < (kSide - 1) * kRow; ++at) {
        const AlongAxis h = along_axis(across, at, 1), v = along_axis(down, at, kRow);
        const float known = h.known + v.known, bend = (h.bend + v.bend) / (6 * std::max(known, 1.0f));
        noise[at] = known > 0 ? bend : -1.0f;
        breaks[at] = h.breaks + v.breaks;
        // A slanting edge crosses both axes: the sum in quadrature avoids counting it twice.
        const float edges = std::sqrt(h.edges * h.edges + v.edges * v.edges);
        const float detail = std::max(h.detail, v.detail);
        edge[at] = edges * (1 / 12.0f) + detail * kDetailInSamples + (h.slopes + v.slopes) * (1 / 24.0f);
        centre[at] = edges * (1 / 24.0f) + detail * kDetailInCentres + std::max(noise[at], 0.0f);
    }
    for (int row = 0; row < kTile; ++row)
        for (int column = 0; column < kTile; column += 4) {
            const std::size_t at = cell(row, column), place = place_in_tile(column, row);
            std::copy_n(&breaks[at], 4, &out.breaks[place]);
            std::copy_n(&edge[at], 4, &out.edge[place]);
            std::copy_n(&noise[at], 4, &out.noise[place]);
            std::copy_n(&centre[at], 4, &out.centre[place]);
        }
}

}  // namespace

bool GBuffer::in_empty_space(std::size_t tile) const noexcept {
    const int tx = static_cast<int>(tile) % tiles_x_, ty = static_cast<int>(tile) / tiles_x_;
    const auto empty = [&](std::size_t other) { return known_[other] != Known::something; };
    const auto row_of_tiles = static_cast<std::size_t>(tiles_x_);
    return empty(tile) && (tx == 0 || empty(tile - 1)) && (tx + 1 == tiles_x_ || empty(tile + 1)) &&
           (ty == 0 || empty(tile - row_of_tiles)) && (ty + 1 == tiles_y_ || empty(tile + row_of_tiles));
}

void GBuffer::contrast(const Frame& f, std::size_t tile, TileContrast& out) const noexcept {
    const auto total = [this](std::size_t t, std::size_t place) {
        const GBufferTile& of = tiles_[t];
        return (of.r[place] + of.g[place] + of.b[place]) / 3;
    };
    contrast(f, tile, total, !f.transport.path.direct, out);
}

void GBuffer::contrast_of_direct(const Frame& f, std::size_t tile, TileContrast& out) const noexcept {
    assert(parts_ == LightParts::both);
    contrast(
        f, tile, [this](std::size_t t, std::size_t place) { return direct_[t][place]; }, false, out);
}

void GBuffer::contrast_of_paths(const Frame& f, std::size_t tile, TileContrast& out) const noexcept {
    assert(parts_ == LightParts::both);
    const auto rest = [this](std::size_t t, std::size_t place) {
        const GBufferTile& of = tiles_[t];
        return (of.r[place] + of.g[place] + of.b[place]) / 3 - direct_[t][place];
    };
    contrast(f, tile, rest, true, out);
}

void GBuffer::put_like(std::size_t tile, std::size_t place, std::size_t other, std::size_t there) noexcept {
    GBufferTile& t = tiles_[tile];
    const GBufferTile& like = tiles_[other];
    t.surface[place] = like.surface[there], t.depth_m[place] = like.depth_m[there];
    t.nx[place] = like.nx[there], t.ny[place] = like.ny[there], t.nz[place] = like.nz[there];
    t.reused[place] = like.reused[there];
    if (parts_ == LightParts::both) direct_[tile][place] = direct_[other][there];
}

void GBuffer::put_background(std::size_t tile, std::size_t place) noexcept {
    GBufferTile& t = tiles_[tile];
    t.r[place] = background_.x, t.g[place] = background_.y, t.b[place] = background_.z;
    t.nx[place] = t.ny[place] = t.nz[place] = t.depth_m[place] = t.reused[place] = 0;
    t.surface[place] = 0;
    if (parts_ == LightParts::both) direct_[tile][place] = mean_band(background_);
}

template <class Radiance>
void GBuffer::contrast(const Frame& f, std::size_t tile, const Radiance& radiance, bool with_reused,
                       TileContrast& out) const noexcept {
    if (in_empty_space(tile)) {
        out = {};
        return;
    }
    Around a;
    gather(f, tile, radiance, a);
    measure_contrasts(a, out);
    out.reused.fill(0);
    if (with_reused)
        for (std::size_t i = 0; i < kTilePixels; ++i) {
            if (tiles_[tile].surface[i] != 0) out.reused[i] = tiles_[tile].reused[i];
            out.centre[i] += out.reused[i];
        }
    const int x_end = width_ - static_cast<int>(tile) % tiles_x_ * kTile;
    const int y_end = height_ - static_cast<int>(tile) / tiles_x_ * kTile;
    if (x_end >= kTile && y_end >= kTile) return;
    for (int y = 0; y < kTile; ++y)  // beyond the image
        for (int x = 0; x < kTile; ++x)
            if (x >= x_end || y >= y_end) {
                const std::size_t place = place_in_tile(x, y);
                out.breaks[place] = 0;
                out.edge[place] = out.noise[place] = out.centre[place] = out.reused[place] = 0;
            }
}

}  // namespace narpa
