/// protocols/lidar/position.h - the Velodyne position packet: time of day and a GPRMC sentence, once a while.
///
/// Source: Velodyne, VLP-16 User Manual 63-9243 Rev. D, section 9.3.3; NMEA 0183 for the sentence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace narpa::vlp16 {

/// unused, time stamp, PPS state, unused, sentence and zeros
inline constexpr std::size_t kPositionPacketBytes = 198 + 4 + 1 + 3 + 306;  ///< 512
/// A position packet goes out with every 14th data packet (manual, section 8.2.2).
inline constexpr std::int64_t kDataPacketsPerPosition = 14;

enum class PpsState : std::uint8_t { none = 0, synchronizing = 1, locked = 2, error = 3 };

/// Writes the packet for this instant, PPS locked. The sentence says whole seconds, a valid fix, latitude and
/// longitude 0: a spacecraft's place is not NMEA's business, its time is. Years 1970 to 2069.
void encode_position(std::int64_t unix_ns, std::span<std::uint8_t, kPositionPacketBytes> out) noexcept;

struct PositionPacket {
    std::uint32_t past_hour_us = 0;
    PpsState pps = PpsState::none;
    std::int64_t unix_s = 0;  ///< UTC of the sentence, whole seconds
};

/// Nothing when the length or the PPS state is not allowed, or the sentence or its checksum is wrong.
[[nodiscard]] std::optional<PositionPacket> decode_position(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace narpa::vlp16
