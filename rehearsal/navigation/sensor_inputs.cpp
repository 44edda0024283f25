#include "rehearsal/navigation/sensor_inputs.h"

#include <fmt/format.h>

#include <algorithm>

namespace narpa::rehearsal {
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
        const VideoFormat format{c.width, c.height, c.format, c.period_ns};
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
