#include "emulator/scene_sensors.h"

#include <fmt/format.h>

#include "emulator/camera_sensor.h"
#include "emulator/lidar_sensor.h"

namespace narpa {
namespace {

/// Opens the sinks of sensor `index`, in the order in which they were given.
template <class Sink>
Result<std::vector<std::unique_ptr<Sink>>> open_sinks(
    const std::vector<std::pair<std::string, std::string>>& outputs, std::size_t index, const auto& sensors,
    std::string_view kind, const std::string& file, const auto& open) {
    std::vector<std::unique_ptr<Sink>> sinks;
    for (const auto& [name, spec] : outputs) {
        auto named = sensor_named(sensors, name, kind, file);
        if (!named) return named.error();
        if (*named != index) continue;
        Result<std::unique_ptr<Sink>> sink = open(spec);
        if (!sink) return sink.error();
        sinks.push_back(*std::move(sink));
    }
    return sinks;
}

Result<std::unique_ptr<Sensor>> open_camera(const World& world, std::size_t index, const RunOptions& o,
                                            bool telemetry) {
    const Scene& scene = world.scene();
    const Camera& c = scene.cameras[index];
    const VideoFormat format{c.width, c.height, c.format, c.period_ns};
    const WhenFull when_full = o.lockstep ? WhenFull::wait : WhenFull::drop;
    auto sinks =
        open_sinks<VideoSink>(o.video, index, scene.cameras, "camera", scene.file,
                              [&](const std::string& spec) { return open_video_sink(spec, format, when_full); });
    if (!sinks) return sinks.error();
    if (sinks->empty()) return std::unique_ptr<Sensor>();
    auto camera = std::make_unique<CameraSensor>(world, index, *std::move(sinks));
    if (telemetry) camera->keep_ledgers();
    if (!o.log_folder.empty())
        if (auto logs = camera->log_to(o.log_folder, o.lockstep); !logs) return logs.error();
    return std::unique_ptr<Sensor>(std::move(camera));
}

Result<std::unique_ptr<Sensor>> open_lidar(const World& world, std::size_t index, const RunOptions& o,
                                           bool /*telemetry*/) {
    const Scene& scene = world.scene();
    auto sinks =
        open_sinks<PacketSink>(o.lidar, index, scene.lidars, "LiDAR", scene.file, [&](const std::string& spec) {
            return open_packet_sink(spec, scene.lidars[index].model->spec().network, scene.epoch_unix_ns,
                                    o.lockstep);
        });
    if (!sinks) return sinks.error();
    if (sinks->empty()) return std::unique_ptr<Sensor>();
    return std::unique_ptr<Sensor>(std::make_unique<LidarSensor>(world, index, *std::move(sinks)));
}

}  // namespace

Result<std::vector<std::unique_ptr<Sensor>>> open_sensors(const World& world, const RunOptions& options,
                                                          bool telemetry) {
    const Scene& scene = world.scene();
    if (!options.video.empty() && scene.cameras.empty()) return Error{"the scene has no camera", scene.file};
    if (!options.lidar.empty() && scene.lidars.empty()) return Error{"the scene has no LiDAR", scene.file};
    std::vector<std::unique_ptr<Sensor>> sensors;
    for (const auto& [count, open] :
         {std::pair{scene.cameras.size(), &open_camera}, std::pair{scene.lidars.size(), &open_lidar}}) {
        for (std::size_t i = 0; i < count; ++i) {
            auto sensor = open(world, i, options, telemetry);
            if (!sensor) return sensor.error();
            if (*sensor) sensors.push_back(*std::move(sensor));  // a sensor without a sink costs nothing
        }
    }
    return sensors;
}

Result<std::unique_ptr<OnlineEstimator>> open_estimator(const World& world, const RunOptions& options,
                                                        const std::vector<std::unique_ptr<Sensor>>& sensors,
                                                        bool telemetry) {
    const Scene& scene = world.scene();
    std::vector<CameraSensor*> cameras;
    for (const auto& sensor : sensors)
        if (auto* camera = dynamic_cast<CameraSensor*>(sensor.get())) cameras.push_back(camera);
    if (cameras.empty())
        return Error{"--estimate needs a camera, expected --video CAMERA=SINK too (SINK may be none)"};
    const std::string name =
        options.estimate_camera.empty() ? std::string(cameras.front()->name()) : options.estimate_camera;
    const auto index = sensor_named(scene.cameras, name, "camera", scene.file);
    if (!index) return index.error();
    for (CameraSensor* camera : cameras) {
        if (camera->name() != name) continue;
        auto tracker = FrameTracker::create(world, *index, *options.estimate);
        if (!tracker) return tracker.error();
        auto estimator = std::make_unique<OnlineEstimator>(*std::move(tracker), world, *index, options.lockstep);
        if (telemetry) estimator->keep_reports();
        if (!options.log_folder.empty())
            if (auto log = estimator->log_to(options.log_folder); !log) return log.error();
        camera->show_to(*estimator);
        return estimator;
    }
    return Error{fmt::format("--estimate {}: this camera has no sink, expected --video {}=SINK too", name, name)};
}

}  // namespace narpa
