#include "protocols/lidar/velodyne_packet.h"

#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::size_t kReturnBytes = 2 + 1, kBlockBytes = 2 + 2 + VelodynePacket::kReturnsPerBlock * kReturnBytes;
constexpr std::size_t kTimeOffset = VelodynePacket::kBlocks * kBlockBytes, kModeOffset = kTimeOffset + 4,
                      kProductOffset = kModeOffset + 1;
static_assert(kProductOffset + 1 == VelodynePacket::kBytes);
constexpr std::uint32_t kHour_us = 3'600'000'000u;

}  // namespace

std::optional<VelodynePacket> VelodynePacket::read(std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.size() != kBytes) return std::nullopt;
    VelodynePacket packet;
    for (int b = 0; b < kBlocks; ++b) {
        const std::uint8_t* at = &bytes[static_cast<std::size_t>(b) * kBlockBytes];
        Block& block = packet.blocks[b];
        block.azimuth_cdeg = get_le<std::uint16_t>(at + 2);
        if (at[0] != 0xFF || at[1] != 0xEE || block.azimuth_cdeg >= kAzimuthTurn) return std::nullopt;
        at += 4;
        for (Return& r : block.returns) {
            r = {get_le<std::uint16_t>(at), at[2]};
            at += kReturnBytes;
        }
    }
    packet.past_hour_us = get_le<std::uint32_t>(&bytes[kTimeOffset]);
    packet.mode = bytes[kModeOffset];
    packet.product = bytes[kProductOffset];
    if (packet.past_hour_us >= kHour_us || packet.mode < strongest || packet.mode > dual) return std::nullopt;
    return packet;
}

void VelodynePacket::write(std::span<std::uint8_t, kBytes> bytes) const noexcept {
    for (int b = 0; b < kBlocks; ++b) {
        std::uint8_t* at = &bytes[static_cast<std::size_t>(b) * kBlockBytes];
        at[0] = 0xFF;
        at[1] = 0xEE;
        put_le(at + 2, blocks[b].azimuth_cdeg);
        at += 4;
        for (const Return& r : blocks[b].returns) {
            put_le(at, r.range_2mm);
            at[2] = r.reflectivity;
            at += kReturnBytes;
        }
    }
    put_le(&bytes[kTimeOffset], past_hour_us);
    bytes[kModeOffset] = mode;
    bytes[kProductOffset] = product;
}

}  // namespace narpa
