#include "protocols/lidar/point_packet.h"

#include <algorithm>
#include <array>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::array<std::uint8_t, 4> kPointMagic{'N', 'L', 'P', 'P'};
constexpr std::uint8_t kPointVersion = 1, kDualFlag = 1;

enum Offset : std::size_t {
    kVersionAt = 4,
    kFlagsAt = 5,
    kRecordsAt = 6,
    kFrameAt = 8,
    kFirstShotAt = 12,
    kTimeAt = 16,
    kShotsAt = 24,
    kRangeStepAt = 28,
    kVelocityStepAt = 32,
    kChecksumAt = 36,
};
static_assert(kChecksumAt + 4 == PointPacket::kHeaderBytes);

/// CRC-32 of all bytes but its own.
std::uint32_t checksum(std::span<const std::uint8_t> packet) noexcept {
    return crc32(packet.subspan(PointPacket::kHeaderBytes), crc32(packet.first(kChecksumAt)));
}

}  // namespace

void PointPacket::put(const PointRecord& r, std::size_t i, std::span<std::uint8_t> packet) noexcept {
    std::uint8_t* at = &packet[bytes(i)];
    put_le(at, r.t_offset_ns);
    put_le(at + 4, static_cast<std::uint32_t>(r.azimuth));
    put_le(at + 8, static_cast<std::uint32_t>(r.elevation));
    put_le(at + 12, r.range);
    put_le(at + 16, static_cast<std::uint32_t>(r.velocity));
    put_le(at + 20, r.reflectivity);
    put_le(at + 22, r.beam);
}

PointRecord PointPacket::record(std::span<const std::uint8_t> packet, std::size_t i) noexcept {
    const std::uint8_t* at = &packet[bytes(i)];
    const auto signed_at = [&](std::size_t offset) {
        return static_cast<std::int32_t>(get_le<std::uint32_t>(at + offset));
    };
    return {.t_offset_ns = get_le<std::uint32_t>(at),
            .azimuth = signed_at(4),
            .elevation = signed_at(8),
            .range = get_le<std::uint32_t>(at + 12),
            .velocity = signed_at(16),
            .reflectivity = get_le<std::uint16_t>(at + 20),
            .beam = get_le<std::uint16_t>(at + 22)};
}

void PointPacket::write(std::span<std::uint8_t> packet) const noexcept {
    std::ranges::copy(kPointMagic, packet.begin());
    packet[kVersionAt] = kPointVersion;
    packet[kFlagsAt] = dual ? kDualFlag : 0;
    put_le(&packet[kRecordsAt], records);
    put_le(&packet[kFrameAt], frame);
    put_le(&packet[kFirstShotAt], first_shot);
    put_le(&packet[kTimeAt], static_cast<std::uint64_t>(frame_unix_ns));
    put_le(&packet[kShotsAt], shots_per_frame);
    put_le(&packet[kRangeStepAt], range_step_um);
    put_le(&packet[kVelocityStepAt], velocity_step_um_s);
    put_le(&packet[kChecksumAt], checksum(packet));
}

std::optional<PointPacket> PointPacket::read(std::span<const std::uint8_t> packet) noexcept {
    if (packet.size() < kHeaderBytes || !std::ranges::equal(packet.first(kPointMagic.size()), kPointMagic) ||
        packet[kVersionAt] != kPointVersion || packet[kFlagsAt] > kDualFlag)
        return std::nullopt;
    PointPacket p;
    p.dual = packet[kFlagsAt] == kDualFlag;
    p.records = get_le<std::uint16_t>(&packet[kRecordsAt]);
    if (packet.size() != bytes(p.records) || get_le<std::uint32_t>(&packet[kChecksumAt]) != checksum(packet))
        return std::nullopt;
    p.frame = get_le<std::uint32_t>(&packet[kFrameAt]);
    p.first_shot = get_le<std::uint32_t>(&packet[kFirstShotAt]);
    p.frame_unix_ns = static_cast<std::int64_t>(get_le<std::uint64_t>(&packet[kTimeAt]));
    p.shots_per_frame = get_le<std::uint32_t>(&packet[kShotsAt]);
    p.range_step_um = get_le<std::uint32_t>(&packet[kRangeStepAt]);
    p.velocity_step_um_s = get_le<std::uint32_t>(&packet[kVelocityStepAt]);
    return p;
}

}  // namespace narpa
