#include "emulator/lidar_unit.h"

namespace narpa {

LidarUnit::LidarUnit(const World& world, std::size_t index)
    : world_(world),
      lidar_(world.scene().lidars[index]),
      model_(*lidar_.model),
      period_ns_(model_.packet_period_ns(lidar_.rate_hz)),
      placement_(world.scene().bodies.size()),
      shots_(model_.spec().shots_per_packet),
      hits_(shots_.size()),
      ranges_m_(shots_.size()),
      reflectivities_(shots_.size()),
      bytes_(model_.spec().data_packet_bytes),
      position_(model_.spec().position_packet_bytes) {
    world_.place(0, lidar_.mount, placement_);
}

void LidarUnit::fire(std::int64_t packet) noexcept {
    model_.shots(packet, lidar_.rate_hz, shots_);
    returns_ = 0;
    for (std::size_t i = 0; i < shots_.size(); ++i) {
        const LidarShot& shot = shots_[i];
        world_.place_moving(packet_start_ns(packet) + shot.t_offset_ns, placement_);
        const Rigid3 T_world_lidar = world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, placement_);
        const Ray beam{T_world_lidar * shot.origin_m, T_world_lidar.q * shot.direction};
        hits_[i] = shoot(world_.tracer(), placement_, beam, lidar_.range_max_m);
        ranges_m_[i] = hits_[i].range_m;
        reflectivities_[i] = hits_[i].reflectivity;
        returns_ += hits_[i].range_m > 0;
    }
    model_.encode(packet, lidar_.rate_hz, world_.scene().epoch_unix_ns, ranges_m_, reflectivities_, bytes_);
}

std::span<const std::uint8_t> LidarUnit::position(std::int64_t packet) noexcept {
    if (position_.empty() || packet % model_.spec().data_packets_per_position != 0) return {};
    model_.encode_position(world_.scene().epoch_unix_ns + t_sent_ns(packet), position_);
    return position_;
}

}  // namespace narpa
