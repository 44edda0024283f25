#include "emulator/lidar_unit.h"

namespace narpa {

LidarUnit::LidarUnit(const World& world, std::size_t index)
    : world_(world), lidar_(world.scene().lidars[index]), placement_(world.scene().bodies.size()) {
    world_.place(0, lidar_.mount, placement_);
}

void LidarUnit::fire(std::int64_t packet) noexcept {
    vlp16::shots(packet, lidar_.rate_hz, shots_);
    std::array<double, vlp16::kShots> ranges{};
    std::array<float, vlp16::kShots> reflectivities{};
    returns_ = 0;
    for (std::size_t i = 0; i < shots_.size(); ++i) {
        const vlp16::Shot& shot = shots_[i];
        world_.place_moving(vlp16::packet_start_ns(packet) + shot.t_offset_ns, placement_);
        const Rigid3 T_world_lidar = world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, placement_);
        const Ray beam{T_world_lidar * shot.origin_m(), T_world_lidar.q * vlp16::direction(shot)};
        hits_[i] = shoot(world_.tracer(), placement_, beam, lidar_.range_max_m);
        ranges[i] = hits_[i].range_m;
        reflectivities[i] = hits_[i].reflectivity;
        returns_ += hits_[i].range_m > 0;
    }
    vlp16::encode(packet, lidar_.rate_hz, world_.scene().epoch_unix_ns, ranges, reflectivities, bytes_);
}

std::span<const std::uint8_t, vlp16::kPositionPacketBytes> LidarUnit::position(std::int64_t packet) noexcept {
    vlp16::encode_position(world_.scene().epoch_unix_ns + t_sent_ns(packet), position_);
    return position_;
}

}  // namespace narpa
