/// renderer/frame/g_buffer.h - one sample per pixel: radiance, normal, depth, surface. Its contrasts give the
/// variance of a pixel's samples and the error of its centre, for adaptive sampling and for the frame's error
/// estimate.
///
/// Neighbouring pixels show the same surface if body, material and sunlight agree, their normals are close, and
/// each lies in the other's tangent plane. Otherwise an edge passes between them. An edge at a random place between
/// two centres leaves the two pixels, together, a mean squared error of contrast^2 / 12 if each is represented by
/// its centre, and of contrast^2 / 6 if by a random point.
///
/// A pixel that differs from both its neighbours is a detail: a bar of width w in pixels, with two such edges. If w
/// is less than 1, only some centres meet it. Averaged over its position, it leaves in each row of pixels that it
/// crosses contrast^2 times
///     w - w^2 - w^3 / 3          for centres, w <= 1/2,
///     1/2 - w + w^2 - w^3 / 3    for centres, 1/2 <= w <= 1,
///     w - w^2 + w^3 / 3          for random points, w <= 1,
/// and for w >= 1 the error of its two edges, 1/6 and 1/3. A single centre meets it in w of the rows up to w = 1,
/// in 2 - w up to w = 2. If all scales are equally frequent (density dw / w), each such hit adds to the edges'
/// error 0.230 contrast^2 for centres and 0.200 contrast^2 for random points.
///
/// Variation on one surface from pixel to pixel, beyond a constant slope, is noise or texture: second differences
/// of independent values of variance v have the mean square 6 v.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "renderer/frame/culling/tile_culling.h"
#include "renderer/frame/frame.h"

namespace narpa {

inline constexpr int kTile = kTileSize;                    ///< pixels per side
inline constexpr std::size_t kTilePixels = kTile * kTile;  ///< four batches of 4 x 4, one after another

/// Index of a pixel in its tile, in the order of the batches.
constexpr std::size_t place_in_tile(int x, int y) noexcept {
    return static_cast<std::size_t>(((y >> 2) * 2 + (x >> 2)) * 16 + (y & 3) * 4 + (x & 3));
}

template <class T>
using PerPixel = std::array<T, kTilePixels>;

/// Stores a batch's values in the places of its pixels. The batches of a whole tile are its blocks of 4 x 4 pixels.
template <class T>
void put_in_tile(const Lanes<T>& from, const Lanes<std::uint8_t>& place, std::size_t n, PerPixel<T>& to) noexcept {
    if (n == kLanes && place[kLanes - 1] == place[0] + kLanes - 1)
        std::copy(from.begin(), from.end(), to.begin() + place[0]);
    else
        for (std::size_t i = 0; i < n; ++i) to[place[i]] = from[i];
}
inline void put_in_tile(const Frame& f, const BatchRadiance& light, const Lanes<std::uint8_t>& place, std::size_t n,
                        PerPixel<float>& r, PerPixel<float>& g, PerPixel<float>& b) noexcept {
    RgbLanes whole;
    if (f.parts == LightParts::both)
        for (std::size_t i = 0; i < n; ++i) whole.put(i, light.total(f.parts, i));
    const RgbLanes& rgb = f.parts == LightParts::both     ? whole
                          : f.parts == LightParts::direct ? light.direct
                                                          : light.path;
    put_in_tile(rgb.r, place, n, r), put_in_tile(rgb.g, place, n, g), put_in_tile(rgb.b, place, n, b);
}

/// One sample of each pixel of a tile.
struct alignas(64) GBufferTile {
    PerPixel<float> r, g, b;     ///< radiance
    PerPixel<float> nx, ny, nz;  ///< normal, world
    PerPixel<float> depth_m;
    PerPixel<float> reused;           ///< variance of light from reused paths, correlated between neighbours
    PerPixel<std::uint32_t> surface;  ///< hash of body, material and sunlight; 0: background
};

/// Variances of mean bands, W^2 m^-4 sr^-2.
struct alignas(64) TileContrast {
    PerPixel<float> breaks;  ///< number of edges between the pixel and its four neighbours
    PerPixel<float> edge;    ///< of one random sample, from edges, details and slopes
    PerPixel<float> noise;   ///< of one random sample, from all else; negative: unknown
    PerPixel<float> reused;  ///< of one random sample, from reused paths (correlated between neighbours)
    PerPixel<float> centre;  ///< expected squared error of the centre

    /// Variance of one random sample of a pixel.
    [[nodiscard]] float of_sample(std::size_t place) const noexcept {
        return edge[place] + std::max(noise[place], 0.0f) + reused[place];
    }
};

class GBuffer {
public:
    GBuffer(int width, int height);

    [[nodiscard]] int width() const noexcept { return width_; }
    [[nodiscard]] int height() const noexcept { return height_; }
    [[nodiscard]] int tiles_x() const noexcept { return tiles_x_; }
    [[nodiscard]] int tiles_y() const noexcept { return tiles_y_; }
    [[nodiscard]] std::size_t tiles() const noexcept { return tiles_.size(); }
    [[nodiscard]] GBufferTile& tile(std::size_t i) noexcept {
        assert(i < tiles_.size());
        return tiles_[i];
    }
    [[nodiscard]] const GBufferTile& tile(std::size_t i) const noexcept {
        assert(i < tiles_.size());
        return tiles_[i];
    }

    /// Starts a frame in which no tile is traced yet; untraced tiles show this background. `parts`: of its light.
    void begin_frame(const Rgb& background, LightParts parts);
    void set_traced(std::size_t tile) noexcept { known_[tile] = Known::background; }
    [[nodiscard]] bool is_traced(std::size_t tile) const noexcept { return known_[tile] != Known::nothing; }
    [[nodiscard]] const Rgb& background() const noexcept { return background_; }
    /// The tile shows more than the background.
    void set_something(std::size_t tile) noexcept { known_[tile] = Known::something; }
    /// True if the tile and its four neighbours show only the background.
    [[nodiscard]] bool in_empty_space(std::size_t tile) const noexcept;

    /// Stores one sample of each of a batch's pixels. `place`: index of each lane's pixel in the tile.
    void store(const Frame& f, const TracedRays& p, const BatchRadiance& light, const Lanes<std::uint8_t>& place,
               std::size_t tile) noexcept;

    /// The same for pixels of several tiles.
    void store(const Frame& f, const TracedRays& p, const BatchRadiance& light, const Lanes<std::uint8_t>& place,
               const Lanes<std::uint32_t>& tile) noexcept;

    /// Computes contrasts from a tile and its neighbours.
    void contrast(const Frame& f, std::size_t tile, TileContrast& out) const noexcept;
    /// The same, in light of two parts of the direct one alone, which has no noise.
    void contrast_of_direct(const Frame& f, std::size_t tile, TileContrast& out) const noexcept;

    /// The same, in light of two parts without the direct one.
    void contrast_of_paths(const Frame& f, std::size_t tile, TileContrast& out) const noexcept;

    /// A pixel without a sample shows the surface that another one does.
    void put_like(std::size_t tile, std::size_t place, std::size_t other, std::size_t there) noexcept;
    void put_background(std::size_t tile, std::size_t place) noexcept;

    /// A tile with a border of its neighbours' pixels.
    struct Around;

private:
    template <class Radiance>
    void gather(const Frame& f, std::size_t tile, const Radiance& radiance, Around& a) const noexcept;
    template <class Radiance>
    void contrast(const Frame& f, std::size_t tile, const Radiance& radiance, bool with_reused,
                  TileContrast& out) const noexcept;
    [[nodiscard]] bool shows_background(const Frame& f, const TracedRays& p,
                                        const BatchRadiance& light) const noexcept;

    int width_, height_, tiles_x_, tiles_y_;
    Rgb background_{};
    std::vector<GBufferTile> tiles_;
    /// Light of two parts: mean band of the direct one. Allocated when first needed.
    std::vector<PerPixel<float>> direct_;
    LightParts parts_ = LightParts::direct;
    /// State of a tile: not traced; only background so far; something else.
    enum class Known : std::uint8_t { nothing, background, something };
    std::vector<Known> known_;
};

}  // namespace narpa
