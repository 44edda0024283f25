#include "emulator/lidar/lidar_unit.h"

#include <algorithm>
#include <numeric>

namespace narpa {

namespace {

/// Shots for which bodies are placed together span no more than this: in between, bodies move along straight lines
/// at constant rates, which is off by acceleration * span^2 / 8: 5e-7 m at 1 m/s^2; a packet of a VLP-16 takes 1.3
/// ms.
constexpr std::int64_t kSpan_ns = 2'000'000;
/// The same where velocities are measured: they are those at the middle of the span, which is off by 5e-5 m/s at 1
/// m/s^2.
constexpr std::int64_t kVelocitySpan_ns = 100'000;

/// Clears the echoes and truth of shots whose laser is off.
void clear_disabled_shots(std::span<const LidarShot> shots, std::span<LidarEchoes> echoes,
                          std::span<LidarReturn> truth) noexcept {
    for (std::size_t i = 0; i < shots.size(); ++i) {
        if (shots[i].fires) continue;
        echoes[i] = {};
        if (!truth.empty()) truth[i] = {};
    }
}

/// Number of the first shots that are fired within the span.
std::size_t fired_within(std::int64_t span_ns, std::span<const LidarShot> shots) noexcept {
    std::size_t n = 1;
    while (n < shots.size() && shots[n].t_offset_ns - shots[0].t_offset_ns <= span_ns) ++n;
    return n;
}

/// Order of a packet's shots, laser by laser: successive shots of one laser are closer together, and so more
/// coherent, than those of neighbouring lasers. In this order, tracing a turn of a VLP-16 takes 0.7 of the time.
std::vector<std::uint32_t> order_by_laser(std::span<const LidarShot> shots) {
    std::vector<std::uint32_t> order(shots.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return shots[i].beam; });
    return order;
}

}  // namespace

LidarUnit::LidarUnit(const World& world, std::size_t index, bool truth)
    : world_(world),
      lidar_(world.scene().lidars[index]),
      model_(*lidar_.model),
      receiver_(world.tracer(), lidar_, world.scene().render.seed, index),
      placement_(world.scene().bodies.size()),
      motions_(truth || spec().measures_velocity ? world.scene().bodies.size() : 0),
      shots_(spec().shots_per_packet),
      echoes_(shots_.size()),
      truth_(truth ? shots_.size() : 0),
      bytes_(spec().data_packet_bytes),
      position_(spec().position_packet_bytes) {
    receiver_.set_medium(world_.render_scene().lidar_medium());
    world_.place(0, lidar_.mount, placement_);
    model_.shots(0, shots_);
    if (fired_within(kSpan_ns, shots_) == shots_.size()) by_laser_ = order_by_laser(shots_);
}

void LidarUnit::fire(std::int64_t packet, LidarUtc epoch) noexcept {
    model_.shots(packet, shots_);
    const std::int64_t start_ns = packet_start_ns(packet);
    fires_ = std::ranges::any_of(shots_, &LidarShot::fires);
    if (fires_) trace_echoes(packet, start_ns);
    if (fires_ && !truth_.empty()) trace_truth(start_ns);
    clear_disabled_shots(shots_, echoes_, truth_);
    returns_ = 0;
    for (const LidarEchoes& e : echoes_)
        for (const LidarEcho& reported : e.reported(spec().returns)) returns_ += reported.range_m > 0 ? 1 : 0;
    model_.encode(packet, epoch, echoes_, bytes_);
}

template <class Work>
void LidarUnit::over_spans(std::int64_t start_ns, std::int64_t span_ns, const Work& work) noexcept {
    for (std::size_t first = 0, n; first < shots_.size(); first += n) {
        const auto rest = std::span<const LidarShot>(shots_).subspan(first);
        n = fired_within(span_ns, rest);
        const Span span{first, n, start_ns + rest.front().t_offset_ns, start_ns + rest[n - 1].t_offset_ns};
        if (span_ns == kVelocitySpan_ns)
            world_.place((span.begin_ns + span.end_ns) / 2, lidar_.mount, placement_, motions_);
        world_.place_moving(span.begin_ns, span.end_ns, placement_);
        work(span);
    }
}

void LidarUnit::put_beam(std::size_t shot, std::int64_t start_ns, const Span& span, RayBatch& beams) noexcept {
    const LidarShot& s = shots_[shot];
    const std::size_t i = beams.n++;
    beams.origin.put(i, s.origin_m);
    beams.direction.put(i, s.direction);
    beams.time[i] = static_cast<double>(start_ns + s.t_offset_ns - span.begin_ns);
}

void LidarUnit::place(const Span& span, RayBatch& beams) noexcept {
    const auto span_ns = static_cast<double>(std::max<std::int64_t>(1, span.end_ns - span.begin_ns));
    for (double& time : beams.time) time /= span_ns;
    place_beams(placement_, lidar_.mount, lidar_.T_mount_lidar, beams);
}

void LidarUnit::trace_echoes(std::int64_t packet, std::int64_t start_ns) noexcept {
    const bool velocity = spec().measures_velocity;
    const auto first_number = static_cast<std::uint64_t>(packet) * shots_.size();
    std::ranges::fill(echoes_, LidarEchoes{});
    over_spans(start_ns, velocity ? kVelocitySpan_ns : kSpan_ns, [&](const Span& span) {
        Lanes<LidarEchoes> echoes;
        const bool by_laser = span.n == by_laser_.size();
        for (std::size_t done = 0; done < span.n;) {
            Lanes<std::size_t> shot;
            RayBatch beams;
            while (beams.n < kLanes && done + beams.n < span.n) {
                const std::size_t next = span.first + done + beams.n;
                shot[beams.n] = by_laser ? by_laser_[next] : next;
                put_beam(shot[beams.n], start_ns, span, beams);
            }
            place(span, beams);
            const std::uint32_t possible =
                receiver_.receive(placement_, beams, first_number + span.first + done,
                                  velocity ? std::span<const Motion>(motions_) : std::span<const Motion>(), echoes);
            for_each_lane(possible, [&](std::size_t i) { echoes_[shot[i]] = echoes[i]; });
            done += beams.n;
        }
    });
}

void LidarUnit::trace_truth(std::int64_t start_ns) noexcept {
    const ShotSettings settings{.range_max_m = lidar_.range_max_m,
                                .multipath = lidar_.receiver.multipath != LidarReceiverModel::Multipath::none,
                                .motions = motions_,
                                .mount = lidar_.mount,
                                .medium = world_.render_scene().lidar_medium()};
    over_spans(start_ns, kVelocitySpan_ns, [&](const Span& span) {
        for (std::size_t first = span.first, end = first + span.n; first < end;) {
            RayBatch beams;
            while (beams.n < kLanes && first + beams.n < end) put_beam(first + beams.n, start_ns, span, beams);
            place(span, beams);
            shoot(world_.tracer(), placement_, beams, settings, std::span(truth_).subspan(first, beams.n));
            first += beams.n;
        }
    });
}

std::span<const std::uint8_t> LidarUnit::position(std::int64_t packet, LidarUtc epoch) noexcept {
    if (position_.empty() || packet % spec().data_packets_per_position != 0) return {};
    model_.encode_position({epoch.unix_ns + t_sent_ns(packet), epoch.synchronised}, position_);
    return position_;
}

}  // namespace narpa
