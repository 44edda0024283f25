/// protocols/lidar/velodyne.h - the Velodyne VLP-16 and HDL-32E.
///
/// Frame (README.md has a drawing): x right, y forward, z up; azimuth is clockwise from +y seen from above. The
/// rotor passes azimuth 0 at simulation time 0. A data packet has 12 blocks of 32 returns, with the rotor's azimuth
/// at each block's first shot in steps of 0.01 deg, ranges in steps of 2 mm, and the first shot's time in whole
/// microseconds past the UTC hour. VLP-16: a block is two firing sequences of 16 lasers, 110.592 us; HDL-32E: one
/// of 32, 46.080 us. With dual returns blocks come in pairs of one azimuth: the last return, then the strongest
/// (the second strongest where that is the last). Intensities are percent of a diffuse reflector, 0 to 100; 101 to
/// 255 are retroreflectors, here on a logarithmic scale up to 1000 times a white diffuse surface; 255 where there
/// is no return. Source: Velodyne, VLP-16 User Manual 63-9243 Rev. D, chapters 8 and 9; HDL-32E User Manual
/// 63-9113; NMEA 0183 for the position packet's sentence.
#pragma once

#include "protocols/lidar/lidar_model.h"

namespace narpa {

[[nodiscard]] const LidarMake& vlp16() noexcept;
[[nodiscard]] const LidarMake& hdl32e() noexcept;

}  // namespace narpa
