#include "emulator/lidar_unit.h"

#include <algorithm>

namespace narpa {

namespace {

/// Shots that are traced together span no more than this: in between, bodies move along straight lines at constant
/// rates, which is off by acceleration * span^2 / 8: 1e-9 m at 1 m/s^2. A VLP-16 fires 16 shots in 35 us.
constexpr std::int64_t kBatchSpan_ns = 100'000;

std::size_t batch_size(std::span<const LidarShot> shots) noexcept {
    std::size_t n = 1;
    while (n < std::min(kLanes, shots.size()) && shots[n].t_offset_ns - shots[0].t_offset_ns <= kBatchSpan_ns) ++n;
    return n;
}

}  // namespace

LidarUnit::LidarUnit(const World& world, std::size_t index)
    : world_(world),
      lidar_(world.scene().lidars[index]),
      model_(*lidar_.model),
      period_ns_(model_.packet_period_ns(lidar_.rate_hz)),
      receiver_(lidar_.receiver, lidar_.range_max_m, world.scene().render.seed, index),
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
    const std::int64_t start_ns = packet_start_ns(packet);
    for (std::size_t first = 0; first < shots_.size();) {
        const auto rest = std::span(shots_).subspan(first), shots = rest.first(batch_size(rest));
        const std::int64_t begin_ns = shots.front().t_offset_ns, end_ns = shots.back().t_offset_ns;
        world_.place_moving(start_ns + begin_ns, start_ns + end_ns, placement_);
        RayBatch beams;
        for (const LidarShot& shot : shots) {
            const double time = static_cast<double>(shot.t_offset_ns - begin_ns) /
                                static_cast<double>(std::max<std::int64_t>(1, end_ns - begin_ns));
            const Rigid3 T_world_lidar = world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, placement_, time);
            beams.put(beams.n++, {T_world_lidar * shot.origin_m, T_world_lidar.q * shot.direction, time});
        }
        const auto number = static_cast<std::uint64_t>(packet) * shots_.size() + first;
        receiver_.receive(world_.tracer(), placement_, beams, number,
                          std::span(hits_).subspan(first, shots.size()));
        first += shots.size();
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
