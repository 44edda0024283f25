/// emulator/lidar_unit.h - one LiDAR under emulation: packet number -> the bytes that the instrument would send.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "emulator/world.h"
#include "protocols/lidar/position.h"
#include "protocols/lidar/vlp16.h"
#include "renderer/lidar/lidar_shot.h"

namespace narpa {

class LidarUnit {
public:
    /// `world` must outlive the unit. Allocates here and never again.
    LidarUnit(const World& world, std::size_t index);

    [[nodiscard]] const Lidar& lidar() const noexcept { return lidar_; }
    /// The packet is complete, and is sent, when its last sequence is over.
    [[nodiscard]] static std::int64_t t_sent_ns(std::int64_t packet) noexcept {
        return vlp16::packet_start_ns(packet + 1);
    }

    /// Fires the 384 shots of a packet, every body where it is at each shot's own time.
    void fire(std::int64_t packet) noexcept;
    /// The packet just fired, as it goes out.
    [[nodiscard]] std::span<const std::uint8_t, vlp16::kDataPacketBytes> bytes() const noexcept { return bytes_; }
    [[nodiscard]] std::size_t returns() const noexcept { return returns_; }
    /// The truth behind the packet: shots and what they met, ranges unquantised.
    [[nodiscard]] std::span<const vlp16::Shot, vlp16::kShots> shots() const noexcept { return shots_; }
    [[nodiscard]] std::span<const LidarReturn, vlp16::kShots> hits() const noexcept { return hits_; }

    /// Whether a position packet follows this data packet, and its bytes.
    [[nodiscard]] static bool position_due(std::int64_t packet) noexcept {
        return packet % vlp16::kDataPacketsPerPosition == 0;
    }
    [[nodiscard]] std::span<const std::uint8_t, vlp16::kPositionPacketBytes> position(std::int64_t packet) noexcept;

private:
    const World& world_;
    Lidar lidar_;
    BodyPoses placement_;
    std::size_t returns_ = 0;
    std::array<vlp16::Shot, vlp16::kShots> shots_{};
    std::array<LidarReturn, vlp16::kShots> hits_{};
    std::array<std::uint8_t, vlp16::kDataPacketBytes> bytes_{};
    std::array<std::uint8_t, vlp16::kPositionPacketBytes> position_{};
};

}  // namespace narpa
