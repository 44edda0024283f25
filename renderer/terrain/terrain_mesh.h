/// renderer/terrain/terrain_mesh.h - triangulates a DEM at levels of detail chosen by an error bound in pixels.
///
/// The grid is cut into tiles of 64 x 64 cells. Each is sampled at every post, or at every 2nd, 4th ... 64th, the
/// coarsest whose error, seen from the nearest point of the path of the sensors, is within the bound. A cell is two
/// triangles, split along the diagonal from its first row and column to its last. Along a common edge the finer of
/// two tiles uses the coarser one's vertices alone, so that there are no cracks. Levels are chosen before the first
/// frame and never change, so that no detail pops between frames.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/terrain/height_source.h"
#include "renderer/terrain/placement.h"

namespace narpa {

struct TerrainOptions {
    double error_px = 0.5;         ///< largest error of the surface, seen from the nearest point of the path
    double pixels_per_rad = 1000;  ///< of the sharpest camera
    double error_m = std::numeric_limits<double>::infinity();  ///< a bound in metres beside it
    std::vector<Vec3>
        seen_from;  ///< the path of the sensors, body frame: points, straight between them; never empty
    std::uint64_t budget_bytes = std::uint64_t{1} << 30;  ///< memory that the surface may take
};

/// Memory per triangle when the scene is loaded, with its share of the vertices and of Embree's hierarchy.
inline constexpr std::uint64_t kTerrainBytesPerTriangle = 160;

struct TerrainMesh {
    Vec3 origin_m{};  ///< of the positions, in the body's frame
    std::vector<Vec3f> positions, normals;
    std::vector<std::array<float, 2>> uvs;            ///< over the whole DEM; v up
    std::vector<std::array<std::uint32_t, 3>> faces;  ///< counter-clockwise seen from above

    struct Summary {
        int columns = 0, rows = 0;
        double spacing_m = 0;  ///< between posts, in the middle
        double lowest_m = 0, highest_m = 0;
        double error_px = 0;  ///< bound that was kept: larger than asked for where the budget is too small
        std::uint64_t full_triangles = 0;      ///< of the whole DEM
        std::array<std::uint32_t, 7> tiles{};  ///< that are sampled at every 2^i-th post
    } summary;
    std::vector<std::string> warnings{};  ///< clauses about the DEM: what it declares and is not used, likely voids
};

/// `progress` is called with the completed share, 0 to 1. Errors say what is wrong with the DEM, without its name.
[[nodiscard]] Result<TerrainMesh> build_terrain(HeightSource& source, const Placement& placement,
                                                const TerrainOptions& options,
                                                const std::function<void(double)>& progress = {});

}  // namespace narpa
