/// emulator/lidar_unit.h - one LiDAR under emulation: packet number -> the bytes that the instrument would send.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "emulator/world.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/lidar/lidar_receiver.h"

namespace narpa {

class LidarUnit {
public:
    /// `world` must outlive the unit. Allocates here and never again.
    LidarUnit(const World& world, std::size_t index);

    [[nodiscard]] const Lidar& lidar() const noexcept { return lidar_; }
    [[nodiscard]] std::int64_t packet_start_ns(std::int64_t packet) const noexcept { return packet * period_ns_; }
    [[nodiscard]] std::int64_t packet_period_ns() const noexcept { return period_ns_; }
    /// The first packet that starts at t_ns >= 0 or later.
    [[nodiscard]] std::int64_t first_packet_from(std::int64_t t_ns) const noexcept {
        return model_.first_packet_from(t_ns, lidar_.rate_hz);
    }
    /// A packet is sent when it is complete, which is when the next one starts.
    [[nodiscard]] std::int64_t t_sent_ns(std::int64_t packet) const noexcept { return packet_start_ns(packet + 1); }

    /// Fires a packet's shots, every body where it is at each shot's own time.
    void fire(std::int64_t packet) noexcept;
    /// The packet just fired, as it goes out.
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return bytes_; }
    [[nodiscard]] std::size_t returns() const noexcept { return returns_; }
    /// What the packet states: shots and their returns, before quantisation.
    [[nodiscard]] std::span<const LidarShot> shots() const noexcept { return shots_; }
    [[nodiscard]] std::span<const LidarReturn> hits() const noexcept { return hits_; }

    /// The position packet that follows this data packet; empty where none does.
    [[nodiscard]] std::span<const std::uint8_t> position(std::int64_t packet) noexcept;

private:
    const World& world_;
    Lidar lidar_;
    const LidarModel& model_;
    std::int64_t period_ns_;
    LidarReceiver receiver_;
    BodyPoses placement_;
    std::size_t returns_ = 0;
    std::vector<LidarShot> shots_;
    std::vector<LidarReturn> hits_;
    std::vector<double> ranges_m_;
    std::vector<float> reflectivities_;
    std::vector<std::uint8_t> bytes_, position_;
};

}  // namespace narpa
