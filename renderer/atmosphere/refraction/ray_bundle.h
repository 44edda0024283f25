/// renderer/atmosphere/refraction/ray_bundle.h - transmittance and in-scattering along the rays of a few pixels,
/// interpolated from fewer integrals.
///
/// For rays from one point that reach space, transmittance and in-scattering are smooth functions of direction; for
/// rays that end near the ground, of direction and of the height of the end. Directions are divided into cells, the
/// same for all bundles from that point. The air is integrated at nine nodes of a cell (for ends near the ground at
/// each of two heights, unless all are at one height) and interpolated by parabolas where these agree with
/// integrals at points between the nodes. Elsewhere (at the horizon, at the limb) the cell is divided along the
/// axes of disagreement until it holds few rays; these are integrated one by one. AirCache caches the cells, so a
/// frame integrates each cell once.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/uninitialized_array.h"
#include "renderer/atmosphere/air_cells.h"
#include "renderer/atmosphere/scattering/scattered_light.h"

namespace narpa {

/// Air along a ray from `origin` to range_m, which may be infinite. `to_sun` null: no sunlight. Positions are
/// metres from the planet's centre, directions unit.
[[nodiscard]] AirLight air_along(const ScatteredLight& light, const Vec3& origin, const Vec3& direction,
                                 double range_m, const Vec3* to_sun) noexcept;

class RayBundle {
public:
    static constexpr std::size_t kMax = 128;  ///< rays
    /// Largest relative difference between interpolated and integrated values at the test points between the nodes,
    /// where the error is largest; most pixels have a smaller one.
    static constexpr float kTolerance = 7e-4f;

    struct Ray {
        Vec3 direction;
        double range_m;
    };

    /// `light`, `to_sun` (may be null) and `cells` outlive it. Tolerance 0: each ray is integrated.
    RayBundle(const ScatteredLight& light, const Vec3& origin, const Vec3* to_sun, AirCache& cells,
              float tolerance = kTolerance) noexcept;

    /// Takes up to kMax rays; writes one value per ray to `out`. Allocates nothing.
    void trace(std::span<const Ray> rays, std::span<AirLight> out) noexcept;

    /// Number of rays along which the air was integrated.
    [[nodiscard]] std::size_t integrals() const noexcept { return integrals_; }

private:
    using Index = std::uint8_t;
    enum class End : std::uint8_t { space, ground, elsewhere };
    /// Charts of directions: four quarters of the horizon, up to 45 degrees above and below, and the directions
    /// about zenith and nadir. In a quarter, u is the tangent of the azimuth; v is a function of the elevation,
    /// dense at the horizon, or, for rays that end near the ground, of the range. About zenith and nadir both are
    /// tangents.
    enum class Chart : std::uint8_t { front, left, back, right, zenith, nadir };
    /// Coordinates of a ray, in units of undivided cells.
    struct Place {
        double u, v, layer;  ///< layer: height of the ray's end
        Chart chart;
        End end;
    };
    /// How often a cell's sides have been halved.
    struct Subdivision {
        std::int8_t u = 0, v = 0, layer = 0;
        friend bool operator==(const Subdivision&, const Subdivision&) = default;
    };
    struct Cell {
        std::int32_t u, v, layer;
        Chart chart;
        End end;
        bool one_layer;  ///< ends are on the layer; else between it and the next
        Subdivision halved;
        friend bool operator==(const Cell&, const Cell&) = default;
    };

    [[nodiscard]] int max_halvings() const noexcept;
    void aim() noexcept;
    void place(std::size_t i) noexcept;
    [[nodiscard]] static Cell cell_of(const Place& p, const Subdivision& halved) noexcept;
    [[nodiscard]] std::uint64_t key(const Cell& c) const noexcept;
    void trace(std::span<Index> set, const Subdivision& halved, int more) noexcept;
    void interpolate(std::span<const Index> set, const Cell& cell, const AirCell& nodes) noexcept;
    void make(const Cell& cell, AirCell& out) noexcept;
    [[nodiscard]] std::optional<AirLight> at(const Cell& cell, double u, double v, double layer) noexcept;
    [[nodiscard]] Vec3 level_direction(Chart chart, double u) const noexcept;
    [[nodiscard]] double range_down_to(const Vec3& direction, double height_m) const noexcept;
    [[nodiscard]] AirLight integrate(const Vec3& direction, double range_m) noexcept;

    const ScatteredLight& light_;
    const Vec3 origin_;
    const Vec3* const to_sun_;
    AirCache& cells_;
    const float tolerance_;
    std::size_t integrals_ = 0;
    std::uint64_t seed_ = 0;  ///< part of the keys that all cells share
    std::span<const Ray> rays_;
    std::span<AirLight> out_;
    Vec3 front_{}, left_{}, up_{};
    double horizon_ = 0;  ///< tangent of the horizon's elevation
    UninitializedArray<Place, kMax> place_;
    UninitializedArray<Cell, kMax> cell_;
};

}  // namespace narpa
