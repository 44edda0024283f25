/// renderer/frame/body_culling.h - which tiles of an image may show a body.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "renderer/camera/scene_camera.h"

namespace narpa {

inline constexpr int kTileSize = 8;  ///< pixels per side

/// A body in the camera's frame, and the camera in the body's. Differences first, rotations then: positions may be
/// 4e8 m from the world's origin.
struct BodyView {
    Vec3 camera_body;               ///< position of the camera
    std::array<Vec3, 3> axes;       ///< the body's, in the camera's frame
    std::array<Vec3, 3> axes_body;  ///< the camera's, in the body's frame
    Vec3 centre_camera;             ///< the body's origin
    double rounding_m;              ///< bound of a ray's displacement by rounding

    BodyView(const Rigid3& T_world_body, const Rigid3& T_world_camera) {
        const Vec3 apart = T_world_body.t - T_world_camera.t;
        const Quat q_camera_body = conjugate(T_world_camera.q) * T_world_body.q;
        camera_body = conjugate(T_world_body.q) * -apart;
        centre_camera = conjugate(T_world_camera.q) * apart;
        axes = columns(q_camera_body);
        axes_body = columns(conjugate(q_camera_body));
        rounding_m = 0x1p-49 * (norm(T_world_body.t) + norm(T_world_camera.t) + norm(apart)) + 1e-12;  // above 0
    }
};

/// A rectangle of tiles, bounds inclusive.
struct TileRect {
    int x_first, y_first, x_last, y_last;
};

/// Splits a rectangle of at least two tiles across its longer side.
inline std::array<TileRect, 2> halves(const TileRect& r) noexcept {
    const int columns = r.x_last - r.x_first + 1, rows = r.y_last - r.y_first + 1;
    TileRect low = r, high = r;
    if (columns >= rows)
        low.x_last = r.x_first + columns / 2 - 1, high.x_first = low.x_last + 1;
    else
        low.y_last = r.y_first + rows / 2 - 1, high.y_first = low.y_last + 1;
    return {low, high};
}

/// A set of tiles of an image, one bit per tile.
class TileMask {
public:
    TileMask(int tiles_x, int tiles_y)
        : tiles_x_(tiles_x),
          tiles_y_(tiles_y),
          words_per_row_((static_cast<std::size_t>(tiles_x) + 63) / 64),
          words_(words_per_row_ * static_cast<std::size_t>(tiles_y)),
          row_first_(tiles_y) {}

    /// The whole image.
    [[nodiscard]] TileRect all() const noexcept { return {0, 0, tiles_x_ - 1, tiles_y_ - 1}; }
    void mark(const TileRect& r) noexcept {
        row_first_ = std::min(row_first_, r.y_first), row_last_ = std::max(row_last_, r.y_last);
        for_each_word(r, [](std::uint64_t& word, std::uint64_t bits) {
            word |= bits;
            return true;
        });
    }
    [[nodiscard]] bool all_marked(const TileRect& r) noexcept {
        return for_each_word(r, [](std::uint64_t& word, std::uint64_t bits) { return (word & bits) == bits; });
    }

    /// Calls f(column, row) for each marked tile, row by row, and clears it.
    template <class F>
    void drain(const F& f) noexcept {
        for (int row = row_first_; row <= row_last_; ++row)
            for (std::size_t w = 0; w < words_per_row_; ++w) {
                std::uint64_t& word = words_[static_cast<std::size_t>(row) * words_per_row_ + w];
                for (; word != 0; word &= word - 1) f(static_cast<int>(64 * w) + std::countr_zero(word), row);
            }
        row_first_ = tiles_y_, row_last_ = -1;
    }

private:
    /// Calls f(word, its bits within the rectangle) until it returns false.
    template <class F>
    bool for_each_word(const TileRect& r, const F& f) noexcept {
        const auto first = static_cast<unsigned>(r.x_first), last = static_cast<unsigned>(r.x_last);
        for (int row = r.y_first; row <= r.y_last; ++row)
            for (std::size_t w = first / 64; w <= last / 64; ++w) {
                std::uint64_t bits = ~0ull;
                if (w == first / 64) bits &= ~0ull << first % 64;
                if (w == last / 64) bits &= ~0ull >> (63 - last % 64);
                if (!f(words_[static_cast<std::size_t>(row) * words_per_row_ + w], bits)) return false;
            }
        return true;
    }

    int tiles_x_, tiles_y_;
    std::size_t words_per_row_;
    std::vector<std::uint64_t> words_;
    int row_first_, row_last_ = -1;  ///< range of rows with marked tiles
};

/// A body's bounding volumes: the leaves of its mesh's box tree, each grown by `slack_m`; without boxes the
/// ellipsoid `bounds`.
struct CulledBody {
    const BodyBounds& bounds;
    std::span<const BoxNode> boxes;
    BodyView view;
    double slack_m;
};
/// The box around these bounds.
[[nodiscard]] BoxNode box_about(const BodyBounds& bounds) noexcept;

/// Marks the tiles that may show the body, by the projection of its boxes or of its ellipsoid. `lens` may be null.
void mark_by_projection(const Pinhole& pinhole, const Camera& camera, const Lens* lens, const CulledBody& body,
                        TileMask& mask) noexcept;
/// The same for any camera model. The rays of a rectangle of tiles lie in a cone about their origin
/// (CameraModel::bounds), the parts of a body in spheres: if the cone and a sphere's cone do not overlap, the
/// rectangle does not show the sphere. The wider of the two is subdivided, down to single tiles and the leaves of
/// the box tree. Looser and slower than the projection.
void mark_by_cones(const CameraModel& model, const Lens* lens, const CulledBody& body, TileMask& mask) noexcept;

}  // namespace narpa
