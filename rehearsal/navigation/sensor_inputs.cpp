#include "rehearsal/navigation/sensor_inputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "estimator/cloud/range_points.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kKept_ns = 3'000'000'000;

}  // namespace

SweepBuffer::SweepBuffer(const Lidar& lidar, std::int64_t epoch_unix_ns)
    : model_(lidar.model),
      turn_ns_(std::llround(1e9 / model_->spec().rate_hz)),
      period_ns_(model_->spec().packet_period_ns),
      epoch_unix_ns_(epoch_unix_ns) {}

std::int64_t SweepBuffer::start_ns(std::int64_t stamp_ns) const noexcept {
    const std::int64_t next_ns = model_->packet_start_ns(model_->first_packet_from(stamp_ns));
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

void SweepBuffer::turn(std::int64_t t_ns, LidarSweep& out) const {
    out.clear();
    SweepReader reader(*model_);
    for (const Packet& p : packets_)
        if (p.t_ns >= t_ns - turn_ns_ && p.t_ns + period_ns_ <= t_ns) reader.append(p.bytes, p.t_ns - t_ns, out);
}

namespace {

/// The source of each sensor, in the order of `sensors`.
Result<std::vector<std::string>> sources_of(const std::vector<std::string>& sensors, const SourceList& given,
                                            const char* flag, const std::string& file) {
    for (const auto& [name, source] : given)
        if (std::ranges::find(sensors, name) == sensors.end())
            return Error{fmt::format("{} {}={}: the scenario does not navigate by \"{}\", expected one of: {}",
                                     flag, name, source, name, fmt::join(sensors, ", ")),
                         file};
    std::vector<std::string> out;
    for (const std::string& sensor : sensors) {
        const auto n = std::ranges::count(given, sensor, &SourceList::value_type::first);
        if (n != 1)
            return Error{fmt::format("{} sources for \"{}\", expected {} {}=SOURCE once", n, sensor, flag, sensor),
                         file};
        out.push_back(std::ranges::find(given, sensor, &SourceList::value_type::first)->second);
    }
    return out;
}

}  // namespace

Result<SensorInputs> open_sensor_inputs(const Scenario& scenario, const SceneModel& model, const SourceList& video,
                                        const SourceList& lidar) {
    const auto frames_from = sources_of(scenario.navigation.cameras, video, "--video", scenario.file);
    if (!frames_from) return frames_from.error();
    const auto packets_from = sources_of(scenario.navigation.lidars, lidar, "--lidar", scenario.file);
    if (!packets_from) return packets_from.error();
    SensorInputs inputs;
    for (std::size_t i = 0; i < frames_from->size(); ++i) {
        const Camera& c = model.scene().cameras[model.cameras()[i]];
        const VideoFormat format = c.video_format();
        auto source = open_video_source((*frames_from)[i], format);
        if (!source) return source.error();
        inputs.cameras.push_back({model.cameras()[i], *std::move(source), frame_bytes(format)});
    }
    for (std::size_t i = 0; i < packets_from->size(); ++i) {
        auto source = open_packet_source((*packets_from)[i]);
        if (!source) return source.error();
        const Lidar& l = model.scene().lidars[model.lidars()[i]];
        inputs.lidars.push_back({*std::move(source), SweepBuffer(l, model.scene().epoch_unix_ns)});
    }
    return inputs;
}

}  // namespace narpa::rehearsal
