/// protocols/lidar/velodyne_packet.h - the data packet of Velodyne's LiDARs with 16 or 32 lasers, field by field.
///
/// Any packet that `read` takes is written again byte for byte. Source: VLP-16 User Manual 63-9243 Rev. D, section
/// 9.3; README.md has the offsets.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

namespace narpa {

struct VelodynePacket {
    static constexpr int kBlocks = 12, kReturnsPerBlock = 32;
    static constexpr int kAzimuthTurn = 36'000;
    static constexpr std::size_t kBytes = 1206;

    enum Mode : std::uint8_t { strongest = 0x37, last = 0x38, dual = 0x39 };

    struct Return {
        std::uint16_t range_2mm = 0;  ///< 0: none
        std::uint8_t reflectivity = 0;
        friend bool operator==(const Return&, const Return&) = default;
    };
    struct Block {
        std::uint16_t azimuth_cdeg = 0;  ///< of its first shot, clockwise, below kAzimuthTurn
        std::array<Return, kReturnsPerBlock> returns{};
    };

    std::array<Block, kBlocks> blocks{};
    /// UTC of the first shot. An hour or more is read too: units have been seen to count on over the full hour.
    std::uint32_t past_hour_us = 0;
    std::uint8_t mode = strongest;
    std::uint8_t product = 0;

    /// Nothing: length, block flag, azimuth or mode are not valid for such a packet.
    [[nodiscard]] static std::optional<VelodynePacket> read(std::span<const std::uint8_t> bytes) noexcept;
    void write(std::span<std::uint8_t, kBytes> bytes) const noexcept;

    /// By how much the rotor turns during each block, 0.01 deg: up to the block `step` further on, before it in the
    /// last ones. Where azimuths jump, as where a limited field of view ends, or step back: the median of the
    /// others; `nominal_cdeg` where there are none. `most_cdeg`: a larger turn is a jump.
    [[nodiscard]] std::array<int, kBlocks> turns_cdeg(int step, int nominal_cdeg, int most_cdeg) const noexcept;
};

}  // namespace narpa
