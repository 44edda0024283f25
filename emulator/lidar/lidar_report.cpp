// The statistics of a LiDAR as JSON and as text.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "emulator/lidar/lidar_sensor.h"
#include "emulator/log/statistics.h"

namespace narpa {

using nlohmann::json;

json LidarSensor::report() const {
    const LidarStats& s = stats_;
    json sinks = json::array();
    for (const auto& sink : sinks_) {
        const PacketCounters c = sink->counters();
        sinks.push_back({{"sink", sink->description()},
                         {"sent", c.sent},
                         {"dropped", c.dropped},
                         {"receiver_dropped", c.receiver_dropped}});
    }
    return {{"name", name()},
            {"packets", s.packets},
            {"sweeps", sweeps()},
            {"skipped", s.skipped},
            {"shots", s.shots},
            {"returns", s.returns},
            {"packets_late", s.late},
            {"wake_late_ms", percentiles(s.wake_late, 1e-6)},
            {"fire_ms", percentiles(s.fire, 1e-6)},
            {"due_to_sent_ms", percentiles(s.hand_over, 1e-6)},
            {"sinks", sinks}};
}

std::string LidarSensor::to_text(bool lockstep) const {
    const LidarStats& s = stats_;
    std::string out = fmt::format("  lidar {}: {} packets = {:.2f} sweeps, {} skipped, {} returns of {} shots\n",
                                  name(), s.packets, sweeps(), s.skipped, s.returns, s.shots);
    out += fmt::format("    p50 / p99 / max: fire {}", latency_text(s.fire));
    if (!lockstep)
        out += fmt::format("; due to sent {}; {} late by more than a packet's period", latency_text(s.hand_over),
                           s.late);
    out += "\n";
    for (const auto& sink : sinks_) {
        const PacketCounters c = sink->counters();
        out += fmt::format("    -> {}: {} {}, {} dropped", sink->description(), c.sent, sink->fate(), c.dropped);
        if (c.receiver_dropped > 0)
            out += fmt::format(
                "; {} lost at a receiver on this machine: its socket's buffer was full, expected a larger "
                "SO_RCVBUF (docs/interfaces.md)",
                c.receiver_dropped);
        out += "\n";
    }
    return out;
}

}  // namespace narpa
