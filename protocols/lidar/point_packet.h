/// protocols/lidar/point_packet.h - the format of narpa's own LiDAR packet, for the instruments that a file
/// describes (pattern_lidar.h). README.md in this folder has the offsets.
///
/// A record states its shot's time and direction, so that a reader needs no calibration.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace narpa {

struct PointRecord {
    static constexpr std::size_t kBytes = 24;
    static constexpr double kAngleSteps_per_rad = 1e8, kReflectivitySteps = 1e3;
    static constexpr std::int32_t kNoVelocity = INT32_MIN;

    std::uint32_t t_offset_ns = 0;        ///< of the shot after its frame's start
    std::int32_t azimuth = 0;             ///< 1e-8 rad, clockwise from y
    std::int32_t elevation = 0;           ///< 1e-8 rad
    std::uint32_t range = 0;              ///< in the packet's steps; 0: no echo
    std::int32_t velocity = kNoVelocity;  ///< in the packet's steps, receding is positive
    std::uint16_t reflectivity = 0;       ///< 0.1 % of a white diffuse surface; saturates
    std::uint16_t beam = 0;
};

struct PointPacket {
    static constexpr std::size_t kHeaderBytes = 40;
    /// So that a UDP datagram fits an Ethernet frame of 1500 bytes.
    static constexpr std::size_t kMaxRecords = (1500 - 28 - kHeaderBytes) / PointRecord::kBytes;

    [[nodiscard]] static constexpr std::size_t bytes(std::size_t records) noexcept {
        return kHeaderBytes + records * PointRecord::kBytes;
    }

    bool dual = false;  ///< records come in pairs, two echoes of one shot
    std::uint16_t records = 0;
    std::uint32_t frame = 0;       ///< frames since simulation time 0
    std::uint32_t first_shot = 0;  ///< of the packet, counted within the frame
    std::uint32_t shots_per_frame = 0;
    std::int64_t frame_unix_ns = 0;                           ///< UTC of the frame's start, ns since 1970
    std::uint32_t range_step_um = 0, velocity_step_um_s = 0;  ///< the latter 0: velocities are not measured

    /// Writes record i.
    static void put(const PointRecord& record, std::size_t i, std::span<std::uint8_t> packet) noexcept;
    /// Record i of a packet that `read` accepted.
    [[nodiscard]] static PointRecord record(std::span<const std::uint8_t> packet, std::size_t i) noexcept;
    /// Writes the header, after all records: it has their checksum. `packet` has bytes(records).
    void write(std::span<std::uint8_t> packet) const noexcept;
    /// Nothing: not a whole packet of this kind with a correct checksum.
    [[nodiscard]] static std::optional<PointPacket> read(std::span<const std::uint8_t> packet) noexcept;
};

}  // namespace narpa
