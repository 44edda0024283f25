// emulator/report.cpp - the statistics of a run as JSON.
#include "emulator/report.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "emulator/camera_sensor.h"
#include "emulator/lidar_sensor.h"
#include "emulator/log/estimate_report.h"

namespace narpa {

using nlohmann::json;

namespace {

json percentiles_ms(const Histogram& h) {
    return {
        {"p50", h.percentile_ns(0.5) * 1e-6}, {"p99", h.percentile_ns(0.99) * 1e-6}, {"max", h.max_ns() * 1e-6}};
}

json percentiles(const auto& h, double unit) {
    return {{"p50", h.percentile_ns(0.5) * unit},
            {"p90", h.percentile_ns(0.9) * unit},
            {"p99", h.percentile_ns(0.99) * unit},
            {"p99.9", h.percentile_ns(0.999) * unit},
            {"max", h.max_ns() * unit}};
}

json of_estimator(const OnlineEstimator& estimator) {
    return {{"camera", estimator.camera().name},
            {"target", estimator.target()},
            {"passed_over", estimator.skipped()},
            {"summary", to_json(summarise(estimator.frames()))}};
}

json bus_document(const CanNode& node) {
    const CommandCounters c = node.counters();
    const CanCounters& b = node.bus().counters();
    json rejected = json::object();
    for (const auto& [cause, count] : c.rejected()) rejected[std::string(cause)] = count;
    return {{"bus", node.bus().description()},
            {"frames_received", b.received},
            {"frames_sent", b.sent},
            {"send_drops", b.send_drops},
            {"receive_overflow", b.receive_overflow},
            {"malformed", b.malformed},
            {"error_frames", b.error_frames},
            {"bus_off", b.bus_off},
            {"interface_down", b.interface_down},
            {"foreign_frames", c.foreign},
            {"commands_taken", c.taken},
            {"commands_missed", c.missed},
            {"rejected", rejected}};
}

}  // namespace

json lateness(const SignedHistogram& late) {
    json out = percentiles(late, 1e-6), bins = json::array();
    for (const LatenessBin& bin : lateness_bins(late))
        bins.push_back(
            {{"up_to_ms", std::isfinite(bin.to_ms) ? json(bin.to_ms) : json(nullptr)}, {"frames", bin.frames}});
    out["bins"] = std::move(bins);
    return out;
}

json CameraSensor::report() const {
    const CameraStats& s = stats_;
    json steps = json::object(), sinks = json::array();
    for (std::size_t i = 0; i < kStepNames.size(); ++i) steps[std::string(kStepNames[i])] = s.steps[i];
    for (const auto& sink : sinks_) {
        const VideoCounters c = sink->counters();
        sinks.push_back({{"sink", sink->description()},
                         {"written", c.written},
                         {"dropped_ring_full", c.ring_full},
                         {"dropped_no_reader", c.no_reader},
                         {"dropped_failed", c.failed},
                         {"reconnects", c.reconnects}});
    }
    return {{"name", name()},
            {"frames", s.frames},
            {"handed_over", s.handed_over},
            {"skipped", s.skipped},
            {"deadlines_missed", s.deadline_missed},
            {"stale", s.stale},
            {"ledgers_lost", s.ledgers_lost},
            {"repeated", s.repeated},
            {"blanked", s.blanked},
            {"steps", steps},
            {"samples_per_pixel", percentiles(s.samples_1e3, 1e-3)},
            {"expected_error", s.error_1e9.count() > 0 ? percentiles(s.error_1e9, 1e-9) : json(nullptr)},
            {"hand_over_after_deadline_ms", lateness(s.late)},
            {"wake_late_ms", percentiles_ms(s.wake_late)},
            {"render_ms", percentiles_ms(s.render)},
            {"mid_exposure_to_hand_over_ms", percentiles_ms(s.hand_over)},
            {"sinks", sinks}};
}

json LidarSensor::report() const {
    const LidarStats& s = stats_;
    json sinks = json::array();
    for (const auto& sink : sinks_) {
        const PacketCounters c = sink->counters();
        sinks.push_back({{"sink", sink->description()}, {"sent", c.sent}, {"dropped", c.dropped}});
    }
    return {{"name", name()},
            {"packets", s.packets},
            {"sweeps", sweeps()},
            {"skipped", s.skipped},
            {"shots", s.shots},
            {"returns", s.returns},
            {"wake_late_ms", percentiles_ms(s.wake_late)},
            {"fire_ms", percentiles_ms(s.fire)},
            {"due_to_sent_ms", percentiles_ms(s.hand_over)},
            {"sinks", sinks}};
}

json report(const Emulator& emulator) {
    json document{
        {"scene", emulator.world().scene().name},
        {"mode", emulator.options().lockstep ? "lockstep" : "real time"},
        {"simulated_s", static_cast<double>(emulator.t_ns()) * 1e-9},
        {"cameras", json::array()},
        {"lidars", json::array()},
        {"estimate", emulator.estimator() ? of_estimator(*emulator.estimator()) : json(nullptr)},
        {"can", emulator.can() ? bus_document(*emulator.can()) : json(nullptr)},
        {"page_faults", {{"minor", emulator.page_faults().minor}, {"major", emulator.page_faults().major}}},
        {"notices", emulator.notices()},
        {"log", emulator.options().log_folder}};
    for (const auto& sensor : emulator.sensors())
        document[std::string(sensor->kind()) + "s"].push_back(sensor->report());
    return document;
}

}  // namespace narpa
