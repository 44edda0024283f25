/// renderer/assets/dem_process.h - DEM files read with GDAL, in a process of its own, narpa-dem-reader: the one
/// place that GDAL is linked to. A damaged file can crash only that process.
#pragma once

#include <limits>
#include <string>

#include "base/result.h"
#include "renderer/terrain/detail.h"
#include "renderer/terrain/terrain_mesh.h"

namespace narpa {

/// A DEM as a scene names it. NaN values are taken from the file.
struct DemRequest {
    /// The frame of the body.
    enum class On : std::uint8_t {
        plane,      ///< x along the columns, mostly east, z up; origin in the middle of the posts, at height 0
        ellipsoid,  ///< that of the planet
        tangent,    ///< x east, y north, z up, at the middle of the posts and height 0, on the ellipsoid
    };
    static constexpr double kFromFile = std::numeric_limits<double>::quiet_NaN();

    std::string path;
    On on = On::plane;
    bool radii = false;  ///< the file has distances from the planet's centre
    double scale = kFromFile, offset_m = kFromFile, no_data = kFromFile;
    double post_spacing_m = kFromFile;
    double equatorial_m = kFromFile, polar_m = kFromFile;
    TerrainDetail detail{};
    TerrainOptions options{};
};

/// Converts a request to an argument of the program, and back; the latter is false if a value is missing.
[[nodiscard]] std::string to_argument(const DemRequest& request);
[[nodiscard]] bool from_argument(const std::string& argument, DemRequest& request);

struct DemMessage {
    static constexpr std::uint64_t kMagic = 0x3130'4d45'444e'0001;
    std::uint64_t magic = kMagic;
    std::string error{};  ///< empty: the terrain follows
    TerrainMesh terrain{};
};

struct DemReaderLimits {
    std::uint64_t memory_bytes = 0;  ///< of the process, beside the budget of the terrain; 0: 1 GiB
    int seconds = 600;               ///< wall time
};

/// Errors: those of the file; a limit that was reached; a crash of the process; narpa-dem-reader is not found.
Result<TerrainMesh> read_dem_in_process(const DemRequest& request, const DemReaderLimits& limits = {});

}  // namespace narpa
