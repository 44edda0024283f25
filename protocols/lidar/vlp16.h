/// protocols/lidar/vlp16.h - the Velodyne VLP-16.
///
/// Frame (README.md has a drawing): x right, y forward, z up; azimuth is clockwise from +y seen from above.
/// A data packet has 12 blocks of two firing sequences of 16 lasers: 384 shots in 1'327'104 ns. Shot k of a packet
/// is laser k % 16 of sequence k / 16, block k / 32. The rotor passes azimuth 0 at simulation time 0. Packets state
/// the strongest return, the rotor's azimuth at each block's first shot in steps of 0.01 deg, ranges in steps of 2
/// mm, and the first shot's time in whole microseconds past the UTC hour. Intensities are percent of a diffuse
/// reflector, 0 to 100; 101 to 255, retro-reflectors, are read and never written; 255 where there is no return.
/// Source: Velodyne, VLP-16 User Manual 63-9243 Rev. D, chapters 8 and 9; NMEA 0183 for the position packet's
/// sentence.
#pragma once

#include "protocols/lidar/lidar_model.h"

namespace narpa {

[[nodiscard]] const LidarModel& vlp16() noexcept;

}  // namespace narpa
