#include "emulator/lidar_unit.h"

#include <algorithm>

namespace narpa {

LidarUnit::LidarUnit(const World& world, std::size_t index)
    : world_(world),
      lidar_(world.scene().lidars[index]),
      model_(*lidar_.model),
      period_ns_(model_.packet_period_ns(lidar_.rate_hz)),
      placement_(world.scene().bodies.size(), kLanes),
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
    for (std::size_t first = 0; first < shots_.size(); first += kLanes) {
        const auto shots = std::span(shots_).subspan(first, std::min(kLanes, shots_.size() - first));
        Lanes<std::int64_t> times_ns;
        for (std::size_t k = 0; k < shots.size(); ++k) times_ns[k] = packet_start_ns(packet) + shots[k].t_offset_ns;
        world_.place_moving(std::span(times_ns).first(shots.size()), placement_);
        RayBatch beams;
        for (const LidarShot& shot : shots) {
            // The k-th shot meets the k-th pose of each path.
            const double time =
                static_cast<double>(beams.n) / static_cast<double>(std::max<std::size_t>(1, shots.size() - 1));
            const Rigid3 T_world_lidar = world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, placement_, time);
            beams.put(beams.n++, {T_world_lidar * shot.origin_m, T_world_lidar.q * shot.direction, time});
        }
        shoot(world_.tracer(), placement_, beams, lidar_.range_max_m,
              std::span(hits_).subspan(first, shots.size()));
    }
    for (std::size_t i = 0; i < shots_.size(); ++i) {
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
