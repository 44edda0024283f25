/// renderer/atmosphere/air_path.h - quadrature nodes along a ray through the air, and the air columns up to each
/// node.
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

/// Gauss-Legendre nodes for one panel of a ray, and the matrix that integrates a function given at the nodes up to
/// each node. Both are exact for polynomials.
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

/// exp(-optical depth) from a ray's start to the nodes of a panel; the aerosol's forward peak counts as unscattered
/// light.
using PanelTransmittance = std::array<Air::Spectrum, PanelRule::kMaxNodes>;

/// The ends of up to five panels along a ray, in ascending order.
struct PanelEnds {
    static constexpr std::size_t kMax = 6;
    std::array<double, kMax> t_m{};
    std::size_t n = 0;  ///< points; 0: the ray misses the air
};

/// Depth below the surface at which a ray ends, so that the ground's own hits decide.
inline constexpr double kBelowGround_m = 1000;

/// Panel ends of a ray of length `range_m` (origin from the planet's centre, metres; unit direction): where it
/// enters and leaves the air, where it is lowest, and, if `to_sun` is given, where it crosses the edge of the
/// planet's shadow. The ray ends 1 km below the surface.
[[nodiscard]] PanelEnds panel_ends(const Air& air, const Vec3& origin, const Vec3& direction, double range_m,
                                   const Vec3* to_sun) noexcept;

/// Fills the panel between two points; advances `columns` to its end.
void fill_panel(const Air& air, const PanelRule& rule, const Vec3& origin, const Vec3& direction, double from_m,
                double to_m, AirColumns& columns, AirPanel& panel) noexcept;

/// The columns along a segment.
[[nodiscard]] AirColumns columns_along(const Air& air, const PanelRule& rule, const Vec3& origin,
                                       const Vec3& direction, double range_m) noexcept;

}  // namespace narpa
