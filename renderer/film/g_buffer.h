/// renderer/film/g_buffer.h - what the rays through the pixels' middles show, kept for planning and for the
/// error of the frame, and what it says of each pixel: how far off is its middle, and how much do samples of it
/// vary?
///
/// Neighbours show the same surface if body, material and sunlight agree, their normals do, and the one lies in the
/// other's tangent plane. Where they do not, an edge passes between them. One between two middles at a random place
/// leaves the two pixels, together, a mean squared error of contrast^2 / 12 if each is told by its middle, and of
/// contrast^2 / 6 if by a random point.
///
/// What stands out from both its neighbours is a detail, a bar of width w in pixels, with two such edges; but where
/// w is less than 1 the middles meet it now and then only, and see nothing of it in between. Averaged over its
/// place, it leaves in each row of pixels that it crosses contrast^2 times
///     w - w^2 - w^3 / 3          to the middles, w <= 1/2,
///     1/2 - w + w^2 - w^3 / 3    to the middles, 1/2 <= w <= 1,
///     w - w^2 + w^3 / 3          to random points, w <= 1,
/// and from w = 1 on what its two edges do, 1/6 and 1/3. One middle alone meets it in w of the rows up to w = 1, in
/// 2 - w up to w = 2. With all scales equally frequent, that is w distributed as dw / w, each such meeting stands
/// for 0.230 contrast^2 beyond the edges' in middles and 0.200 contrast^2 in random points.
///
/// What varies on one surface from pixel to pixel, beyond a steady slope, is noise or texture: second differences
/// of independent values of variance v have the mean square 6 v.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "renderer/film/tile_culling.h"
#include "renderer/integrator/integrator.h"

namespace narpa {

inline constexpr int kTile = kTileSize;                    ///< pixels a side
inline constexpr std::size_t kTilePixels = kTile * kTile;  ///< four packets of 4 x 4, one after another

/// Place of a pixel of a tile, in the order of the packets.
constexpr std::size_t place_in_tile(int x, int y) noexcept {
    return static_cast<std::size_t>(((y >> 2) * 2 + (x >> 2)) * 16 + (y & 3) * 4 + (x & 3));
}

template <class T>
using PerPixel = std::array<T, kTilePixels>;

/// The middles of a tile.
struct alignas(64) GBufferTile {
    PerPixel<float> r, g, b;                    ///< radiance
    PerPixel<float> paths_r, paths_g, paths_b;  ///< of it what paths brought, where the light has two parts
    PerPixel<float> nx, ny, nz;                 ///< normal, world
    PerPixel<float> depth_m;
    PerPixel<float> shared;           ///< variance of light that paths share, which neighbours do not show
    PerPixel<std::uint32_t> surface;  ///< of body, material and sunlight; 0: background
};

/// Variances of mean bands, W^2 m^-4 sr^-2.
struct alignas(64) TileContrast {
    PerPixel<float> breaks;  ///< edges between it and its four neighbours
    PerPixel<float> edge;    ///< of one random sample of the pixel, for edges, details and slopes
    PerPixel<float> noise;   ///< of one sample, for all else; negative: not known
    PerPixel<float> shared;  ///< of one sample, for light that the tile's paths share: neighbours are off alike
    PerPixel<float> middle;  ///< expected squared error of the middle
};

/// Looks of all tiles of an image.
class GBuffer {
public:
    GBuffer(int width, int height);

    [[nodiscard]] int width() const noexcept { return width_; }
    [[nodiscard]] int height() const noexcept { return height_; }
    [[nodiscard]] int tiles_x() const noexcept { return tiles_x_; }
    [[nodiscard]] int tiles_y() const noexcept { return tiles_y_; }
    [[nodiscard]] std::size_t tiles() const noexcept { return looks_.size(); }
    [[nodiscard]] GBufferTile& tile(std::size_t i) noexcept { return looks_[i]; }
    [[nodiscard]] const GBufferTile& tile(std::size_t i) const noexcept { return looks_[i]; }

    /// Which tiles have looks in this frame; the others show this background.
    void begin_frame(const Rgb& background);
    void set_looked_at(std::size_t tile) noexcept { known_[tile] = Known::background; }
    [[nodiscard]] bool looked_at(std::size_t tile) const noexcept { return known_[tile] != Known::nothing; }

    /// Puts down what a packet of middles has met. `place`: of each lane in the tile.
    void store(const Frame& f, const Packet& p, const PacketLight& light, const Lanes<std::uint8_t>& place,
               std::size_t tile) noexcept;

    /// What a tile and its neighbours say of its pixels.
    void contrast(const Frame& f, std::size_t tile, TileContrast& out) const noexcept;

    /// A tile with a rim of its neighbours.
    struct Around;

private:
    void gather(const Frame& f, std::size_t tile, Around& a) const noexcept;
    [[nodiscard]] bool shows_background(const Frame& f, const Packet& p, const PacketLight& light) const noexcept;
    [[nodiscard]] bool in_empty_space(std::size_t tile) const noexcept;

    int width_, height_, tiles_x_, tiles_y_;
    Rgb background_{};
    std::vector<GBufferTile> looks_;
    /// Of a tile: not looked at; no more than the background so far; something.
    enum class Known : std::uint8_t { nothing, background, something };
    std::vector<Known> known_;
};

}  // namespace narpa
