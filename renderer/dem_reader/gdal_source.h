/// renderer/dem_reader/gdal_source.h - reads DEM files with GDAL.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "renderer/assets/dem_process.h"
#include "renderer/dem_reader/void_detector.h"

namespace narpa {

/// An open DEM and its placement. `spacing`: between posts, in the middle of the DEM.
struct OpenDem {
    std::unique_ptr<HeightSource> heights;
    Placement placement;
    PostSpacing spacing;
    std::vector<std::string> warnings;    ///< about what the file declares and is not used
    std::shared_ptr<VoidDetector> voids;  ///< complete when all heights have been read
};

/// GeoTIFF, PDS3, PDS4, ISIS3 cubes and PNG; the first band. Errors say what is wrong, without the file's name.
Result<OpenDem> open_with_gdal(const DemRequest& request);

}  // namespace narpa
