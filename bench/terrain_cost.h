/// bench/terrain_cost.h - time of a ray into terrain over that of one into a mesh of the visible triangles alone.
///
/// The ground is fractal and generated; a nadir-pointing camera descends over its middle. From each height the rays
/// through all pixel centres are traced, 4 x 4 pixels together, into
/// - the terrain, its levels of detail chosen for the whole descent;
/// - a mesh of those of its triangles that the view sees: that any of 8 x 8 rays in a pixel meets;
/// - a mesh of those that the rays through the pixel centres meet, a part of these where triangles are smaller than
///   pixels;
/// - a terrain of the same ground with levels for this height alone. Times are CPU times of one thread; the
/// candidates take turns, and medians are reported.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/result.h"

namespace narpa {

struct TerrainCostSettings {
    int posts = 4000;  ///< along each side
    double spacing_m = 2;
    int width = 640, height = 480;
    double fov_deg = 60;                           ///< across
    std::vector<double> heights_m{3000, 285, 35};  ///< above the ground
    double from_m = 3000, to_m = 10;               ///< the descent
    int visible_rays = 8;                          ///< in a pixel, each way, that decide what is visible
    int turns = 7;                                 ///< that give a median
};

/// Of the rays of one view.
struct RayCost {
    std::size_t triangles = 0;  ///< of the mesh
    double ns = 0;              ///< a ray
};

struct TerrainCostRow {
    double height_m = 0;
    RayCost terrain{}, visible{}, met{}, for_this_height{};
    /// Of the rays that decide what is visible: all; those that pass the terrain, and those that meet it from
    /// below: cracks.
    std::size_t rays = 0, missed = 0, from_below = 0;
    [[nodiscard]] double ratio() const { return terrain.ns / visible.ns; }
};

struct TerrainCost {
    std::size_t triangles = 0, all_triangles = 0;  ///< of the terrain; of the DEM
    double build_s = 0;                            ///< CPU time from heights to the hierarchy
    std::vector<TerrainCostRow> rows;
};

[[nodiscard]] Result<TerrainCost> measure_terrain_cost(const TerrainCostSettings& settings,
                                                       const std::function<void(const std::string&)>& progress);

/// Most that a ray may cost, over one in the mesh of the visible triangles.
inline constexpr double kTerrainRatioMost = 1.3;
/// Rows that miss it, or that have cracks, one sentence each.
[[nodiscard]] std::vector<std::string> terrain_cost_faults(const TerrainCost& cost);

}  // namespace narpa
