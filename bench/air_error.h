/// bench/air_error.h - what shells, steps, tables and wavelengths of an atmosphere cost, and the error that they
/// leave.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace narpa {

/// The result for one value of a setting, with all others at their finest.
struct AirErrorRow {
    int setting = 0;  ///< shells, steps, heights of the table, wavelengths of a band, 1e4 times the tolerance
    double rms = 0, most = 0;  ///< relative errors over views; refraction: arcsec at 85 and at 89 degrees
    double time_s = 0;         ///< of a ray, or to make the tables; refraction: of a ray
    std::size_t bytes = 0;     ///< of the tables
    bool is_default = false;
};

struct AirErrors {
    std::vector<AirErrorRow> shells, steps, tables, bands;
    std::vector<AirErrorRow> bundles;  ///< of tiles of 8 x 8 pixels against each ray by itself (ray_bundle.h)
};

/// Views of the Earth's sky at turbidity 3: from the ground, from an aeroplane and from orbit, with the Sun from 60
/// degrees above the horizon to 6 below. Views fainter than a thousandth of the brightest with the same Sun are
/// left out. `progress` is called with each step.
[[nodiscard]] AirErrors measure_air_errors(const std::function<void(const std::string&)>& progress);

/// A physical sky, Hosek and Wilkie's and the path-traced one at one place: radiance of the green band for an
/// irradiance of 1.
struct SkyComparison {
    double turbidity = 0, elevation_deg = 0, zenith_deg = 0, azimuth_deg = 0;
    double physical = 0, hosek_wilkie = 0, path_traced = 0, path_traced_error = 0;
    bool aureole = false;  ///< within 9 degrees of the Sun
};
[[nodiscard]] std::vector<SkyComparison> compare_skies(std::size_t paths,
                                                       const std::function<void(const std::string&)>& progress);

}  // namespace narpa
