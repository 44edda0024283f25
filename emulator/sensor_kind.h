/// emulator/sensor_kind.h - the table of the kinds of sensors that a run may have. A new kind implements Sensor and
/// has a row here; the loop stays as it is.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/lidar/packet_sink.h"
#include "drivers/video/video_sink.h"
#include "emulator/run_options.h"
#include "emulator/sensor.h"

namespace narpa {

class CameraSensor;
class LidarSensor;

/// The sensors of a run. Those whose kind others need to know are registered when they are opened.
struct OpenSensors {
    std::vector<std::unique_ptr<Sensor>> all;  ///< in the order of the table
    std::vector<CameraSensor*> cameras;        ///< frame observers get their frames
    std::vector<LidarSensor*> lidars;
    /// Sinks by the name of their sensor, from a run that this one follows: they are not opened again.
    std::map<std::string, std::vector<std::unique_ptr<VideoSink>>, std::less<>> kept_video{};
    std::map<std::string, std::vector<std::unique_ptr<PacketSink>>, std::less<>> kept_packets{};
};

struct SensorKind {
    std::string_view name;  ///< "camera": Sensor::kind, and with an s its list in the report
    /// Adds the sensors for which the options name sinks; one without a sink costs nothing. Errors name sensor,
    /// sink or file.
    Status (*open)(const World& world, const RunOptions& options, OpenSensors& out);
};

[[nodiscard]] std::span<const SensorKind> sensor_kinds() noexcept;

}  // namespace narpa
