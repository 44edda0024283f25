#include "rehearsal/navigation/sweep_buffer.h"

#include <cmath>

#include "estimator/cloud/sweep_points.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kHour_ns = 3'600'000'000'000, kMicrosecond_ns = 1000;
constexpr std::int64_t kKept_ns = 3'000'000'000;

/// The stamp is cut to whole microseconds; packets begin on a grid of their own.
std::int64_t on_grid(std::int64_t t_ns) {
    const std::int64_t next = (t_ns + kMicrosecond_ns - 1) / vlp16::kPacketPeriodNs * vlp16::kPacketPeriodNs;
    return next >= t_ns ? next : t_ns;
}

}  // namespace

SweepBuffer::SweepBuffer(const Lidar& lidar, std::int64_t epoch_unix_ns)
    : turn_ns_(std::llround(1e9 / lidar.rate_hz)), epoch_unix_ns_(epoch_unix_ns) {}

bool SweepBuffer::take(std::span<const std::uint8_t> bytes, std::int64_t reference_ns) {
    const auto data = vlp16::decode(bytes);
    if (!data) {
        ++bad_;
        return false;
    }
    // The stamp counts within the hour: the nearest such time to the reference.
    const std::int64_t past_hour_ns = kMicrosecond_ns * static_cast<std::int64_t>(data->past_hour_us);
    std::int64_t off_ns = (past_hour_ns - epoch_unix_ns_ - reference_ns) % kHour_ns;
    if (off_ns < -kHour_ns / 2) off_ns += kHour_ns;
    if (off_ns >= kHour_ns / 2) off_ns -= kHour_ns;
    packets_.push_back({on_grid(reference_ns + off_ns), *data});
    ++received_;
    while (packets_.front().t_ns < packets_.back().t_ns - kKept_ns) packets_.pop_front();
    return true;
}

bool SweepBuffer::complete_to(std::int64_t t_ns) const noexcept {
    return !packets_.empty() && packets_.back().t_ns + 2 * vlp16::kPacketPeriodNs > t_ns;
}

void SweepBuffer::turn(std::int64_t t_ns, std::vector<RangePoint>& out) const {
    out.clear();
    for (const Packet& p : packets_)
        if (p.t_ns >= t_ns - turn_ns_ && p.t_ns + vlp16::kPacketPeriodNs <= t_ns)
            append_points(p.data, p.t_ns - t_ns, out);
}

}  // namespace narpa::rehearsal
