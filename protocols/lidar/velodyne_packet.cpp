#include "protocols/lidar/velodyne_packet.h"

#include <algorithm>
#include <cstdlib>

#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::size_t kReturnBytes = 2 + 1, kBlockBytes = 2 + 2 + VelodynePacket::kReturnsPerBlock * kReturnBytes;
constexpr std::size_t kTimeOffset = VelodynePacket::kBlocks * kBlockBytes, kModeOffset = kTimeOffset + 4,
                      kProductOffset = kModeOffset + 1;
static_assert(kProductOffset + 1 == VelodynePacket::kBytes);

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
    if (packet.mode < strongest || packet.mode > dual) return std::nullopt;
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

std::array<int, VelodynePacket::kBlocks> VelodynePacket::turns_cdeg(int step, int nominal_cdeg,
                                                                    int most_cdeg) const noexcept {
    std::array<int, kBlocks> turns{}, steady{};
    std::size_t n = 0;
    for (int b = 0; b < kBlocks; ++b) {
        const int from = b + step < kBlocks ? b : b - step;
        const int turn = blocks[from + step].azimuth_cdeg - blocks[from].azimuth_cdeg;
        turns[b] = turn < 0 ? turn + kAzimuthTurn : turn;
        if (turns[b] <= most_cdeg) steady[n++] = turns[b];
    }
    std::sort(steady.begin(), steady.begin() + n);
    const int median = n == 0 ? nominal_cdeg : steady[n / 2];
    constexpr int kRounding_cdeg = 2;
    for (int& turn : turns)
        if (turn > most_cdeg || std::abs(turn - median) > median / 2 + kRounding_cdeg) turn = median;
    return turns;
}

}  // namespace narpa
