/// protocols/lidar/vlp16.h - the Velodyne VLP-16: when and where each laser fires, and its data packet.
///
/// Frame (README.md has a drawing): x right, y forward, z up; azimuth is clockwise from +y seen from above.
/// A packet is 12 blocks of two firing sequences of 16 lasers: 384 shots. Shot k of a packet is laser k % 16 of
/// sequence k / 16, block k / 32. Packet p starts exactly p * 1'327'104 ns after time 0, and the rotor passes
/// azimuth 0 at time 0.
/// Source: Velodyne, VLP-16 User Manual 63-9243 Rev. D, chapter 9. No sockets, no allocation.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/vec3.h"

namespace narpa::vlp16 {

inline constexpr int kLasers = 16, kSequencesPerBlock = 2, kBlocks = 12;
inline constexpr int kShotsPerBlock = kLasers * kSequencesPerBlock;     ///< 32
inline constexpr int kShots = kShotsPerBlock * kBlocks;                 ///< 384
inline constexpr std::int64_t kLaserPeriodNs = 2'304;                   ///< from one laser to the next
inline constexpr std::int64_t kSequencePeriodNs = 24 * kLaserPeriodNs;  ///< 55.296 us: 16 lasers and a recharge
inline constexpr std::int64_t kBlockPeriodNs = kSequencesPerBlock * kSequencePeriodNs;  ///< 110.592 us
inline constexpr std::int64_t kPacketPeriodNs = kBlocks * kBlockPeriodNs;               ///< 1.327104 ms

inline constexpr std::size_t kBlockBytes = 2 + 2 + kShotsPerBlock * (2 + 1);        ///< 100
inline constexpr std::size_t kDataPacketBytes = kBlocks * kBlockBytes + 4 + 1 + 1;  ///< 1206
inline constexpr double kRangeQuantumM = 0.002;
inline constexpr double kRangeMaxM = 65535 * kRangeQuantumM;      ///< 131.07 m: the most that a packet can say
inline constexpr double kRotationHzMin = 5, kRotationHzMax = 20;  ///< 300 to 1200 rpm
inline constexpr std::uint8_t kReturnStrongest = 0x37, kProductVlp16 = 0x22;

/// Elevation in degrees by laser number, which is also the firing order (manual, table 9-1).
inline constexpr std::array<double, kLasers> kElevationDeg{-15, 1, -13, 3,  -11, 5,  -9, 7,
                                                           -7,  9, -5,  11, -3,  13, -1, 15};
/// Height of each laser over the sensor's origin, metres (manual, table 9-1, "vertical correction"). A ray starts
/// at (0, 0, height) and its range counts from there: a reader that adds the correction to z, as the manual asks,
/// gets the surface; one that does not (PCL) is up to 11.2 mm off in z, as with the instrument itself. README.md,
/// "Where a ray starts".
inline constexpr std::array<double, kLasers> kOriginHeightM{0.0112, -0.0007, 0.0097, -0.0022, 0.0081, -0.0037,
                                                            0.0066, -0.0051, 0.0051, -0.0066, 0.0037, -0.0081,
                                                            0.0022, -0.0097, 0.0007, -0.0112};

/// One laser pulse, in the LiDAR's frame.
struct Shot {
    std::int64_t t_offset_ns = 0;  ///< after the packet's first shot
    double azimuth_rad = 0;        ///< [0, 2 pi): where the rotor truly points at this shot's own time
    double elevation_rad = 0;
    double origin_height_m = 0;  ///< the ray starts at (0, 0, origin_height_m)
    int laser = 0;

    [[nodiscard]] Vec3 origin_m() const noexcept { return {0, 0, origin_height_m}; }
};

/// Unit vector: (cos w sin a, cos w cos a, sin w).
[[nodiscard]] Vec3 direction(double azimuth_rad, double elevation_rad) noexcept;
[[nodiscard]] inline Vec3 direction(const Shot& s) noexcept {
    return direction(s.azimuth_rad, s.elevation_rad);
}

[[nodiscard]] constexpr std::int64_t packet_start_ns(std::int64_t packet) noexcept {
    return packet * kPacketPeriodNs;
}
/// Time of shot 0..383 after the packet's first shot.
[[nodiscard]] constexpr std::int64_t shot_offset_ns(int shot) noexcept {
    return shot / kLasers * kSequencePeriodNs + shot % kLasers * kLaserPeriodNs;
}
/// Azimuth of the rotor in revolutions, [0, 1). `rotation_hz` is positive.
[[nodiscard]] double rotor_revolutions(std::int64_t t_ns, double rotation_hz) noexcept;

/// The 384 shots of packet `packet` (0, 1, ...), in firing order.
void shots(std::int64_t packet, double rotation_hz, std::span<Shot, kShots> out) noexcept;

/// Writes a strongest-return packet. Block azimuths are the rotor's at the block's first shot, to 0.01 deg; the
/// time stamp is whole microseconds past the UTC hour of the first shot.
/// `range_m` counts from the ray's origin; 0, negative, NaN, or more than kRangeMaxM is "no return" and is written
/// as 0; others are rounded to 2 mm. `reflectivity` is that of a diffuse surface, 1 = 100 %, clamped to 0..1 (the
/// wire's 101..255 are retro-reflectors) and ignored where there is no return.
/// `epoch_unix_ns`: UTC of simulation time 0, ns since 1970.
void encode(std::int64_t packet, double rotation_hz, std::int64_t epoch_unix_ns,
            std::span<const double, kShots> range_m, std::span<const float, kShots> reflectivity,
            std::span<std::uint8_t, kDataPacketBytes> out) noexcept;

/// A data packet as it stands on the wire.
struct DataPacket {
    std::array<std::uint16_t, kBlocks> azimuth_cdeg{};  ///< 0..35999
    std::array<std::uint16_t, kShots> range_2mm{};      ///< 0: no return
    std::array<std::uint8_t, kShots> reflectivity{};    ///< 0..100 diffuse, 101..255 retro-reflector
    std::uint32_t past_hour_us = 0;                     ///< of the first shot
    std::uint8_t return_mode = 0, product = 0;
};

/// Nothing when the length, a block's flag, an azimuth, or the time stamp is not what the manual allows, when the
/// product is not a VLP-16, or in dual return mode (whose blocks come in pairs).
[[nodiscard]] std::optional<DataPacket> decode(std::span<const std::uint8_t> bytes) noexcept;

/// One return, as the manual computes it: precision azimuth (section 9.5) and vertical correction applied.
struct Point {
    Vec3 position_m{};  ///< LiDAR frame
    double range_m = 0, azimuth_rad = 0, elevation_rad = 0;
    std::int64_t t_offset_ns = 0;  ///< after the packet's first shot
    std::uint8_t reflectivity = 0;
    std::uint8_t laser = 0;
    std::uint16_t shot = 0;  ///< 0..383
};

/// Writes the packet's returns in firing order and says how many there are.
std::size_t points(const DataPacket& packet, std::span<Point, kShots> out) noexcept;

}  // namespace narpa::vlp16
