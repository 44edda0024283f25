/// protocols/lidar/reflectivity_code.h - calibrated reflectivity in 8 bits, as Velodyne and Ouster state it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace narpa {

/// Diffuse surfaces in percent to 100; above, retroreflectors from 101 to 255 as the logarithm of 1 to 1000 times
/// white. The makers' manuals give the two ranges of codes and no scale for the upper one.
[[nodiscard]] inline std::uint8_t reflectivity_code(float reflectivity) noexcept {
    if (!(reflectivity > 0)) return 0;
    if (reflectivity <= 1) return static_cast<std::uint8_t>(std::lround(100 * reflectivity));
    const double code = 101 + 154 * std::log10(static_cast<double>(reflectivity)) / 3;
    return static_cast<std::uint8_t>(std::min(255.0, std::floor(code)));
}

}  // namespace narpa
