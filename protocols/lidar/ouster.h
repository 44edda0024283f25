/// protocols/lidar/ouster.h - the Ouster OS1 with 16, 32, 64 or 128 beams.
///
/// Frame: the maker's sensor frame, a quarter of a turn about z: x right, y forward (the maker's x), z up; the
/// origin is the centre of the sensor's base. All beams of a column fire at once; a turn of 512, 1024 or 2048
/// columns starts with column 0, which points along the maker's lidar x axis, backwards, at whole turns of
/// simulation time. It turns clockwise seen from above. A packet has 16 columns, or as many as the metadata
/// state, each with its own time: UTC in ns
/// since 1970, as from PTP.
///
/// A ray starts where the beam leaves the rotor (`beam_to_lidar_transform`), and its range counts from there. The
/// range in a packet is longer by the maker's n, the distance of that point from the axis. Source: Ouster, Firmware
/// User Manual, "Coordinate Frames and XYZ Calculation" and "Lidar Data Packet Format"; README.md.
///
/// Azimuth of a LidarShot: of the direction, counter-clockwise from the lidar's x axis, as the maker counts it.
#pragma once

#include <span>

#include "protocols/lidar/lidar_model.h"

namespace narpa {

/// os1-16, os1-32, os1-64, os1-128.
[[nodiscard]] std::span<const LidarMake* const> ouster_makes() noexcept;

}  // namespace narpa
