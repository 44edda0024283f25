/// protocols/lidar/livox.h - the Livox Mid-360: 200,000 points a second in a rosette that does not repeat.
///
/// Frame: z up, as the maker's, a quarter of a turn about z from it: the maker's x (forward) is y here, its y
/// (left) is -x. All rays start in the origin. Source: Livox, Livox LiDAR Communication Protocol - Mid360, v1.4.11,
/// "Point Cloud & IMU Data Protocol"; Mid-360 User Manual (field of view, rated ranges, reflectivity); README.md.
#pragma once

#include "protocols/lidar/lidar_model.h"

namespace narpa {

/// A point packet (data type 1: Cartesian, 32 bits) in little-endian bytes: a header of 36, then 96 points of 14.
struct LivoxPacket {
    static constexpr std::size_t kPoints = 96, kPointBytes = 4 + 4 + 4 + 1 + 1;
    static constexpr std::size_t kHeaderBytes = 1 + 2 + 2 + 2 + 2 + 1 + 1 + 1 + 12 + 4 + 8;
    static constexpr std::size_t kBytes = kHeaderBytes + kPoints * kPointBytes;
    static constexpr std::int64_t kPoint_ns = 5'000;  ///< from a point to the next
};

/// The rosette, which stands for the maker's unpublished pattern. The beam turns 10 times a second, clockwise seen
/// from above, while its elevation swings sinusoidally between the limits of the field of view. The number of
/// swings a turn is 66 and the golden ratio's fraction, so that turn after turn fills the widest gaps first.
struct LivoxRosette {
    static constexpr double kTurns_hz = 10, kSwingsPerTurn = 66.61803398874989;
    static constexpr double kLowest_deg = -7, kHighest_deg = 52;
    /// Unit direction of point n since simulation time 0, n >= 0.
    [[nodiscard]] static Vec3 direction(std::int64_t n) noexcept;
};

[[nodiscard]] const LidarMake& mid360() noexcept;

}  // namespace narpa
