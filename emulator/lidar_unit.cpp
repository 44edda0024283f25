#include "emulator/lidar_unit.h"

#include <algorithm>

namespace narpa {

namespace {

/// Shots that are traced together span no more than this: in between, bodies move along straight lines at constant
/// rates, which is off by acceleration * span^2 / 8: 1e-9 m at 1 m/s^2. A VLP-16 fires 16 shots in 35 us.
constexpr std::int64_t kBatchSpan_ns = 100'000;

/// A laser that is off.
void put_out(std::span<const LidarShot> shots, std::span<LidarEchoes> echoes,
             std::span<LidarReturn> truth) noexcept {
    for (std::size_t i = 0; i < shots.size(); ++i) {
        if (shots[i].fires) continue;
        echoes[i] = {};
        if (!truth.empty()) truth[i] = {};
    }
}

std::size_t batch_size(std::span<const LidarShot> shots) noexcept {
    std::size_t n = 1;
    while (n < std::min(kLanes, shots.size()) && shots[n].t_offset_ns - shots[0].t_offset_ns <= kBatchSpan_ns) ++n;
    return n;
}

}  // namespace

LidarUnit::LidarUnit(const World& world, std::size_t index, bool truth)
    : world_(world),
      lidar_(world.scene().lidars[index]),
      model_(*lidar_.model),
      receiver_(lidar_, world.scene().render.seed, index),
      placement_(world.scene().bodies.size()),
      motions_(truth || spec().measures_velocity ? world.scene().bodies.size() : 0),
      shots_(spec().shots_per_packet),
      echoes_(shots_.size()),
      truth_(truth ? shots_.size() : 0),
      bytes_(spec().data_packet_bytes),
      position_(spec().position_packet_bytes) {
    world_.place(0, lidar_.mount, placement_);
}

void LidarUnit::fire(std::int64_t packet) noexcept {
    model_.shots(packet, shots_);
    const std::int64_t start_ns = packet_start_ns(packet);
    fires_ = std::ranges::any_of(shots_, &LidarShot::fires);
    for (std::size_t first = 0; fires_ && first < shots_.size();) {
        const auto rest = std::span(shots_).subspan(first), shots = rest.first(batch_size(rest));
        const std::int64_t begin_ns = shots.front().t_offset_ns, end_ns = shots.back().t_offset_ns;
        if (!motions_.empty()) world_.place(start_ns + (begin_ns + end_ns) / 2, lidar_.mount, placement_, motions_);
        world_.place_moving(start_ns + begin_ns, start_ns + end_ns, placement_);
        RayBatch beams;
        for (const LidarShot& shot : shots) {
            const double time = static_cast<double>(shot.t_offset_ns - begin_ns) /
                                static_cast<double>(std::max<std::int64_t>(1, end_ns - begin_ns));
            const Rigid3 T_world_lidar = world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, placement_, time);
            beams.put(beams.n++, {T_world_lidar * shot.origin_m, T_world_lidar.q * shot.direction, time});
        }
        const auto number = static_cast<std::uint64_t>(packet) * shots_.size() + first;
        receiver_.receive(world_.tracer(), placement_, beams, number, motions_,
                          std::span(echoes_).subspan(first, shots.size()));
        if (!truth_.empty())
            shoot(world_.tracer(), placement_, beams,
                  {.range_max_m = lidar_.range_max_m,
                   .multipath = lidar_.receiver.multipath,
                   .motions = motions_,
                   .mount = lidar_.mount},
                  std::span(truth_).subspan(first, shots.size()));
        first += shots.size();
    }
    put_out(shots_, echoes_, truth_);
    returns_ = 0;
    for (const LidarEchoes& e : echoes_)
        for (const LidarEcho& reported : e.reported(spec().returns)) returns_ += reported.range_m > 0 ? 1 : 0;
    model_.encode(packet, world_.scene().epoch_unix_ns, echoes_, bytes_);
}

std::span<const std::uint8_t> LidarUnit::position(std::int64_t packet) noexcept {
    if (position_.empty() || packet % spec().data_packets_per_position != 0) return {};
    model_.encode_position(world_.scene().epoch_unix_ns + t_sent_ns(packet), position_);
    return position_;
}

}  // namespace narpa
