/// renderer/dem_reader/height_declaration.h - what a DEM file declares about its numbers.
#pragma once

#include <gdal.h>

#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/assets/dem_process.h"

namespace narpa {

/// How a stored number becomes a height: height_m = metres_per_number * number + offset_m, unless it marks no data.
struct HeightDeclaration {
    double metres_per_number = 1, offset_m = 0;
    std::vector<double> no_data{};  ///< numbers that mark posts without a height, beside those of GDAL's mask
    double lowest = -kNoLimit, highest = kNoLimit;  ///< valid numbers
    std::vector<double> palette{};        ///< the number that each stored number stands for; empty: itself
    std::vector<std::string> warnings{};  ///< clauses about what is declared and not used

    static constexpr double kNoLimit = std::numeric_limits<double>::infinity();
};

/// Reads unit, direction, scale, offset, marks of missing data and palette of the first band. Keys of the request
/// replace what the file declares: `scale` its scale and its unit. Errors: units that are no length; a palette of
/// colours; several bands; complex numbers.
Result<HeightDeclaration> read_height_declaration(GDALDatasetH file, const DemRequest& request);

/// Metres of a unit of length by one of its usual names or abbreviations, in any case; 0 if it is not known.
double metres_of_unit(std::string name);

}  // namespace narpa
