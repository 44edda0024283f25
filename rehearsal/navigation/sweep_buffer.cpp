#include "rehearsal/navigation/sweep_buffer.h"

#include <cmath>

#include "estimator/cloud/sweep_points.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kKept_ns = 3'000'000'000;

}  // namespace

SweepBuffer::SweepBuffer(const Lidar& lidar, std::int64_t epoch_unix_ns)
    : model_(lidar.model),
      rate_hz_(lidar.rate_hz),
      turn_ns_(std::llround(1e9 / lidar.rate_hz)),
      period_ns_(model_->packet_period_ns(lidar.rate_hz)),
      epoch_unix_ns_(epoch_unix_ns) {}

std::int64_t SweepBuffer::start_ns(std::int64_t stamp_ns) const noexcept {
    const std::int64_t next_ns = model_->packet_start_ns(model_->first_packet_from(stamp_ns, rate_hz_), rate_hz_);
    return next_ns - stamp_ns < model_->spec().time_resolution_ns ? next_ns : stamp_ns;
}

bool SweepBuffer::take(std::span<const std::uint8_t> bytes, std::int64_t reference_ns) {
    const auto unix_ns = model_->packet_time(bytes, epoch_unix_ns_ + reference_ns);
    if (!unix_ns) {
        ++bad_;
        return false;
    }
    packets_.push_back({start_ns(*unix_ns - epoch_unix_ns_), {bytes.begin(), bytes.end()}});
    ++received_;
    while (packets_.front().t_ns < packets_.back().t_ns - kKept_ns) packets_.pop_front();
    return true;
}

bool SweepBuffer::complete_to(std::int64_t t_ns) const noexcept {
    return !packets_.empty() && packets_.back().t_ns + 2 * period_ns_ > t_ns;
}

void SweepBuffer::turn(std::int64_t t_ns, std::vector<RangePoint>& out) const {
    out.clear();
    std::vector<LidarPoint> decoded(model_->spec().shots_per_packet);
    for (const Packet& p : packets_)
        if (p.t_ns >= t_ns - turn_ns_ && p.t_ns + period_ns_ <= t_ns)
            append_points(std::span(decoded).first(model_->points(p.bytes, decoded)), p.t_ns - t_ns, out);
}

}  // namespace narpa::rehearsal
