/// renderer/assets/star_catalogue.h - stars as a file lists them (docs/scene.md, "Star catalogues").
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "base/vec3.h"

namespace narpa {

struct CatalogueStar {
    std::string name;
    double ra_deg = 0, dec_deg = 0;  ///< ICRS, at the catalogue's epoch
    double v_magnitude = 0;
    double b_v = 0.65;                           ///< the Sun's where the file has none
    double pm_ra_mas_yr = 0, pm_dec_mas_yr = 0;  ///< along the great circles; that in right ascension holds cos dec
};

inline constexpr const char* kStarHeader = "name,ra_deg,dec_deg,v_mag,b_v,pm_ra_mas_yr,pm_dec_mas_yr";

/// Comma-separated values under the header above; lines that are empty or begin with '#' are skipped. Errors name
/// the file, the line and the column.
[[nodiscard]] Result<std::vector<CatalogueStar>> read_star_catalogue(const std::string& file);

/// Unit vector in ICRS axes so many Julian years after the catalogue's epoch. Moves along a straight line across
/// the line of sight: neither parallax nor approach, which turns Barnard's star, the worst, by 6 arcsec a century.
[[nodiscard]] Vec3 star_direction(const CatalogueStar& star, double years);

}  // namespace narpa
