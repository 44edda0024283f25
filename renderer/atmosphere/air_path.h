/// renderer/atmosphere/air_path.h - a ray's way through the air: nodes of a quadrature, and the columns up to them.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "base/vec3.h"
#include "renderer/atmosphere/air.h"

namespace narpa {

/// Lengths of air at reference density, metres.
struct AirColumns {
    float gas = 0, aerosol = 0, ozone = 0;
};

/// Gauss-Legendre nodes of a panel of a ray, and the matrix that integrates what is known at the nodes up to each
/// of them: both exact for polynomials.
class PanelRule {
public:
    static constexpr std::size_t kMaxNodes = 32;
    explicit PanelRule(std::size_t nodes);

    std::size_t n;
    std::array<float, kMaxNodes> node{}, weight{};
    std::vector<float> up_to;  ///< [j * n + i]: weight of node j in the integral up to node i
};

/// A part of a ray on which the height only rises or only falls. Nodes are dense where the air is.
struct AirPanel {
    std::size_t n = 0;
    using Nodes = std::array<float, PanelRule::kMaxNodes>;
    Nodes t_m, length_m, height_m;                   ///< from the ray's start; weight of the node; above ground
    Nodes gas, aerosol, ozone;                       ///< densities
    Nodes gas_before, aerosol_before, ozone_before;  ///< columns from the ray's start, metres
};

/// exp(-optical depth) from a ray's start to the nodes of a panel, with the aerosol's forward peak as no
/// scattering.
using PanelTransmittance = std::array<Air::Spectrum, PanelRule::kMaxNodes>;

/// Up to five panels between points of a ray, in order.
struct PanelEnds {
    static constexpr std::size_t kMost = 6;
    std::array<double, kMost> t_m{};
    std::size_t n = 0;  ///< points; 0: the ray misses the air
};

/// Where a ray (from the planet's centre, metres; unit direction) of a length enters and leaves the air, passes its
/// lowest point, and crosses the edge of the planet's shadow, where `to_sun` is given. It ends 1 km below the
/// surface.
[[nodiscard]] PanelEnds panel_ends(const Air& air, const Vec3& origin, const Vec3& direction, double range_m,
                                   const Vec3* to_sun) noexcept;

/// Fills the panel between two points; advances `columns` to its end.
void fill_panel(const Air& air, const PanelRule& rule, const Vec3& origin, const Vec3& direction, double from_m,
                double to_m, AirColumns& columns, AirPanel& panel) noexcept;

/// The columns along a segment.
[[nodiscard]] AirColumns columns_along(const Air& air, const PanelRule& rule, const Vec3& origin,
                                       const Vec3& direction, double range_m) noexcept;

}  // namespace narpa
