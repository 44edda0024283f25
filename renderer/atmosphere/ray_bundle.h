/// renderer/atmosphere/ray_bundle.h - air along the rays of a few pixels, integrated along fewer of them.
///
/// Along rays from one point that reach space, what the air does is a smooth function of direction; along rays that
/// end near the ground, of direction and of the height of the end. Directions are divided into cells, the same for
/// all bundles from that point: air is integrated at nine nodes of a cell (ends near the ground: of each of two
/// heights, where one does not do), and interpolated by parabolas where these agree with the integrals at points
/// between. Where they do not (at the horizon, at the limb), the cell is divided along the sides on which they
/// differ, until there are not many rays in it, and each ray is integrated. Cells are kept in AirCells, so that a
/// frame integrates each once.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/uninitialized_array.h"
#include "renderer/atmosphere/air_cells.h"
#include "renderer/atmosphere/scattered_light.h"

namespace narpa {

/// From `origin` as far as range_m, which may be infinite. `to_sun` null: no sunlight. Positions are metres from
/// the planet's centre, directions unit.
[[nodiscard]] AirLight air_along(const ScatteredLight& light, const Vec3& origin, const Vec3& direction,
                                 double range_m, const Vec3* to_sun) noexcept;

class RayBundle {
public:
    static constexpr std::size_t kMost = 128;  ///< rays
    /// Largest relative difference between the nodes. Errors of pixels are smaller: it is largest there.
    static constexpr float kTolerance = 7e-4f;

    struct Ray {
        Vec3 direction;
        double range_m;
    };

    /// `light`, `to_sun` (may be null) and `cells` outlive it. Tolerance 0: each ray is integrated.
    RayBundle(const ScatteredLight& light, const Vec3& origin, const Vec3* to_sun, AirCells& cells,
              float tolerance = kTolerance) noexcept;

    /// Of up to kMost rays, `out` one for each. Allocates nothing.
    void trace(std::span<const Ray> rays, std::span<AirLight> out) noexcept;

    /// How often the air was integrated.
    [[nodiscard]] std::size_t integrals() const noexcept { return integrals_; }

private:
    using Index = std::uint8_t;
    enum class End : std::uint8_t { space, ground, elsewhere };
    /// Charts of directions: four quarters of the horizon, up to 45 degrees above and below, and the directions
    /// about zenith and nadir. u is the tangent of the azimuth in a quarter; v tells the elevation, and is dense at
    /// the horizon; or, of rays that end near the ground, the range. About zenith and nadir both are tangents.
    enum class Chart : std::uint8_t { front, left, back, right, zenith, nadir };
    /// In steps of undivided cells.
    struct Place {
        double u, v, layer;  ///< layer: of the height of the ray's end
        Chart chart;
        End end;
    };
    /// How often a cell's sides have been halved.
    struct Halvings {
        std::int8_t u = 0, v = 0, layer = 0;
        friend bool operator==(const Halvings&, const Halvings&) = default;
    };
    struct Cell {
        std::int32_t u, v, layer;
        Chart chart;
        End end;
        bool one_layer;  ///< ends are on the layer; else between it and the next
        Halvings halved;
        friend bool operator==(const Cell&, const Cell&) = default;
    };

    [[nodiscard]] int most_halvings() const noexcept;
    void aim() noexcept;
    void place(std::size_t i) noexcept;
    [[nodiscard]] static Cell cell_of(const Place& p, const Halvings& halved) noexcept;
    [[nodiscard]] std::uint64_t key(const Cell& c) const noexcept;
    void trace(std::span<Index> set, const Halvings& halved, int more) noexcept;
    void interpolate(std::span<const Index> set, const Cell& cell, const AirCell& nodes) noexcept;
    void make(const Cell& cell, AirCell& out) noexcept;
    [[nodiscard]] std::optional<AirLight> at(const Cell& cell, double u, double v, double layer) noexcept;
    [[nodiscard]] Vec3 level_direction(Chart chart, double u) const noexcept;
    [[nodiscard]] double range_down_to(const Vec3& direction, double height_m) const noexcept;
    [[nodiscard]] AirLight integrate(const Vec3& direction, double range_m) noexcept;

    const ScatteredLight& light_;
    const Vec3 origin_;
    const Vec3* const to_sun_;
    AirCells& cells_;
    const float tolerance_;
    std::size_t integrals_ = 0;
    std::uint64_t seed_ = 0;  ///< of keys
    std::span<const Ray> rays_;
    std::span<AirLight> out_;
    Vec3 front_{}, left_{}, up_{};
    double horizon_ = 0;  ///< tangent of its elevation
    UninitializedArray<Place, kMost> place_;
    UninitializedArray<Cell, kMost> cell_;
};

}  // namespace narpa
