#include "renderer/trace/pixel_looks.h"

#include <algorithm>
#include <cmath>

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr int kSide = kTile + 2;  // with a rim of neighbours
constexpr int kRow = 16;          // values from row to row: more than there are, as many as a vector holds

/// Two middles show one surface if their normals are less than 6 degrees apart and the line between them less than
/// 12 degrees off the tangent plane.
constexpr float kSameNormal = 0.9945f;
constexpr float kOffPlane2 = 0.0432f;  // squared sine

/// What a detail that one middle has met stands for, of all scales together.
constexpr float kDetailInMiddles = 0.230f, kDetailInSamples = 0.200f;

/// Rows one after another, and what a step to the right or down from the last needs.
template <class T>
using Grid = std::array<T, (kSide + 2) * kRow>;

/// What neighbours say of each other: this one's and the next's, to the right or below.
struct Pairs {
    Grid<float> difference, edge;  // edge: 1 or 0
};

}  // namespace

struct alignas(64) PixelLooks::Around {
    Grid<float> radiance{}, nx{}, ny{}, nz{};
    Grid<float> depth{}, px{}, py{}, pz{};  // positions are the camera's, in the world's axes
    Grid<std::uint32_t> surface{};
};

PixelLooks::PixelLooks(int width, int height)
    : width_(width),
      height_(height),
      tiles_x_((width + kTile - 1) / kTile),
      tiles_y_((height + kTile - 1) / kTile),
      looks_(static_cast<std::size_t>(tiles_x_) * static_cast<std::size_t>(tiles_y_)),
      looked_at_(looks_.size(), 0) {}

void PixelLooks::begin_frame(const Rgb& background) {
    background_ = mean_band(background);
    std::fill(looked_at_.begin(), looked_at_.end(), std::uint8_t{0});
}

void PixelLooks::store(const Frame& f, const Packet& p, const RgbPerRay& radiance, const Lanes<std::uint8_t>& place,
                       TileLooks& tile) noexcept {
    const Vec3 axis = f.T_world_camera.q * Vec3{0, 0, 1};
    for (std::size_t i = 0; i < p.rays.n; ++i) {
        const std::size_t at = place[i];
        tile.r[at] = radiance.r[i], tile.g[at] = radiance.g[i], tile.b[at] = radiance.b[i];
        const bool met = p.hits.body[i] >= 0;
        tile.surface[at] = 0;
        tile.nx[at] = tile.ny[at] = tile.nz[at] = tile.depth_m[at] = 0;
        if (!met) continue;
        const std::uint32_t lit = f.quick && is_set(p.lit, i) ? 1u : 0u;
        const auto body = static_cast<std::uint32_t>(p.hits.body[i] + 1);
        const auto material = static_cast<std::uint32_t>(p.hits.material[i]);
        tile.surface[at] = ((body * 0x9e3779b1u) ^ (material * 0x85ebca6bu)) << 2 | 2u | lit;
        const Vec3 n = p.hits.shading_normal[i];
        tile.nx[at] = static_cast<float>(n.x), tile.ny[at] = static_cast<float>(n.y);
        tile.nz[at] = static_cast<float>(n.z);
        tile.depth_m[at] = static_cast<float>(p.hits.range_m[i] * dot(p.rays.direction[i], axis));
    }
}

void PixelLooks::gather(const Frame& f, std::size_t tile, Around& a) const noexcept {
    const int tx = static_cast<int>(tile) % tiles_x_, ty = static_cast<int>(tile) / tiles_x_;
    const auto right = vec_cast<float>(f.T_world_camera.q * Vec3{1 / f.camera.fx, 0, 0});
    const auto down = vec_cast<float>(f.T_world_camera.q * Vec3{0, 1 / f.camera.fy, 0});
    const auto ahead =
        vec_cast<float>(f.T_world_camera.q * Vec3{-f.camera.cx / f.camera.fx, -f.camera.cy / f.camera.fy, 1});
    for (int row = 0; row < kSide; ++row) {
        const int y = std::clamp(ty * kTile + row - 1, 0, height_ - 1);
        for (int column = 0; column < kSide; ++column) {
            const int x = std::clamp(tx * kTile + column - 1, 0, width_ - 1);
            const auto at = static_cast<std::size_t>(row * kRow + column);
            const auto from = static_cast<std::size_t>(y / kTile * tiles_x_ + x / kTile);
            if (!looked_at(from)) {
                a.radiance[at] = background_;
                a.surface[at] = 0;
                continue;
            }
            const TileLooks& t = looks_[from];
            const std::size_t place = place_in_tile(x % kTile, y % kTile);
            a.radiance[at] = (t.r[place] + t.g[place] + t.b[place]) / 3;
            a.surface[at] = t.surface[place];
            a.nx[at] = t.nx[place], a.ny[at] = t.ny[place], a.nz[at] = t.nz[place];
            const Vec3f p =
                (ahead + static_cast<float>(x) * right + static_cast<float>(y) * down) * t.depth_m[place];
            a.px[at] = p.x, a.py[at] = p.y, a.pz[at] = p.z;
        }
    }
}

namespace {

/// Compares each with the one `step` further on.
template <class Around>
[[gnu::always_inline]] inline void compare(const Around& a, int step, Pairs& pairs) {
    for (int i = 0; i < kSide * kRow; ++i) {
        const auto at = static_cast<std::size_t>(i), next = static_cast<std::size_t>(i + step);
        const float turn = a.nx[at] * a.nx[next] + a.ny[at] * a.ny[next] + a.nz[at] * a.nz[next];
        const float dx = a.px[next] - a.px[at], dy = a.py[next] - a.py[at], dz = a.pz[next] - a.pz[at];
        const float off = a.nx[at] * dx + a.ny[at] * dy + a.nz[at] * dz;
        const float d = a.radiance[next] - a.radiance[at];
        const bool steady = turn > kSameNormal && off * off <= kOffPlane2 * (dx * dx + dy * dy + dz * dz);
        const bool same = a.surface[at] == a.surface[next] && (a.surface[at] == 0 ? d == 0 : steady);
        pairs.difference[at] = d;
        pairs.edge[at] = same ? 0.0f : 1.0f;
    }
}

/// What the two pairs of a pixel along one axis say.
struct AlongAxis {
    float edges, slopes;  ///< squared contrasts
    float detail;         ///< of a peak or a hollow between two edges
    float breaks;         ///< edges
    float bend, known;    ///< squared second difference; 1: there is one
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

NARPA_EACH_ISA void judge(const PixelLooks::Around& a, Pairs& across, Pairs& down, TileContrast& out) noexcept {
    compare(a, 1, across);
    compare(a, kRow, down);
    for (int y = 0; y < kTile; ++y)
        for (int x = 0; x < kTile; ++x) {
            const auto at = static_cast<std::size_t>((y + 1) * kRow + x + 1);
            const AlongAxis h = along_axis(across, at, 1), v = along_axis(down, at, kRow);
            const float known = h.known + v.known;
            const float noise = known > 0 ? (h.bend + v.bend) / (6 * known) : -1.0f;
            const std::size_t place = place_in_tile(x, y);
            out.breaks[place] = h.breaks + v.breaks;
            out.noise[place] = noise;
            // The steps of a slanting edge are crossed along both axes: together, not twice.
            const float edges = std::sqrt(h.edges * h.edges + v.edges * v.edges);
            const float detail = std::max(h.detail, v.detail);
            out.edge[place] = edges * (1 / 12.0f) + detail * kDetailInSamples + (h.slopes + v.slopes) * (1 / 24.0f);
            out.middle[place] = edges * (1 / 24.0f) + detail * kDetailInMiddles + std::max(noise, 0.0f);
        }
}

}  // namespace

void PixelLooks::contrast(const Frame& f, std::size_t tile, TileContrast& out) const noexcept {
    Around a;
    Pairs across, down;
    gather(f, tile, a);
    judge(a, across, down, out);
    const int x_end = width_ - static_cast<int>(tile) % tiles_x_ * kTile;
    const int y_end = height_ - static_cast<int>(tile) / tiles_x_ * kTile;
    if (x_end >= kTile && y_end >= kTile) return;
    for (int y = 0; y < kTile; ++y)  // beyond the image
        for (int x = 0; x < kTile; ++x)
            if (x >= x_end || y >= y_end) {
                const std::size_t place = place_in_tile(x, y);
                out.breaks[place] = 0;
                out.edge[place] = out.noise[place] = out.middle[place] = 0;
            }
}

}  // namespace narpa
