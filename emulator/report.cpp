// The statistics of a run as JSON and as text.
#include "emulator/report.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/constants.h"
#include "emulator/camera/camera_sensor.h"
#include "emulator/lidar/lidar_sensor.h"
#include "emulator/log/estimate_report.h"

namespace narpa {

using nlohmann::json;

template <class H>
json percentiles(const H& h, double unit) {
    json out = json::object();
    for (const auto& [name, p] : kPercentiles) out[name] = h.percentile_ns(p) * unit;
    return out;
}
template json percentiles(const Histogram&, double);
template json percentiles(const SignedHistogram&, double);

namespace {

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
            {"clients_left", node.hub() ? json(node.hub()->clients_left()) : json(nullptr)},
            {"foreign_frames", c.foreign},
            {"frames_not_logged", c.not_logged},
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
    json control = nullptr;
    if (control_) {
        const CameraControlCounters c = control_->counters();
        control = {{"commands", c.commands},
                   {"commands_refused", c.commands_refused},
                   {"triggers", c.triggers},
                   {"triggers_refused", c.triggers_refused},
                   {"triggers_dropped", c.triggers_dropped},
                   {"states_lost", s.states_lost}};
    }
    return {{"name", name()},
            {"control", control},
            {"frames", s.frames},
            {"handed_over", s.handed_over},
            {"not_taken", s.not_taken},
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
            {"wake_late_ms", percentiles(s.wake_late, 1e-6)},
            {"render_ms", percentiles(s.render, 1e-6)},
            {"mid_exposure_to_hand_over_ms", percentiles(s.hand_over, 1e-6)},
            {"sinks", sinks}};
}

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
        {"advice", advice(emulator)},
        {"failures", failures(emulator)},
        {"passed", failures(emulator).empty()},
        {"log", emulator.options().log_folder}};
    for (const auto& sensor : emulator.sensors())
        document[std::string(sensor->kind()) + "s"].push_back(sensor->report());
    return document;
}

// --- Text -------------------------------------------------------------------------------------------------------

namespace {

std::string latency(const Histogram& h) {
    return fmt::format("{:.2f} / {:.2f} / {:.2f} ms", h.percentile_ns(0.5) * 1e-6, h.percentile_ns(0.99) * 1e-6,
                       h.max_ns() * 1e-6);
}

using Counts = std::vector<std::pair<std::string_view, std::uint64_t>>;

/// "3 bad_checksum, 1 past", or "none".
std::string non_zero(const Counts& counts) {
    std::string text;
    for (const auto& [name, n] : counts)
        if (n > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, name);
    return text.empty() ? "none" : text;
}

/// "2 dropped (1 ring full, 1 no reader)", "0 dropped".
std::string dropped(const Counts& causes) {
    std::uint64_t all = 0;
    for (const auto& [name, n] : causes) all += n;
    return fmt::format("{} dropped{}", all, all > 0 ? " (" + non_zero(causes) + ")" : "");
}

std::string bus_text(const CanNode& node) {
    const CommandCounters c = node.counters();
    const CanCounters& b = node.bus().counters();
    return fmt::format("  can {}: {} commands taken, {} missed, rejected: {}\n", node.bus().description(), c.taken,
                       c.missed, non_zero(c.rejected())) +
           fmt::format(
               "    {} frames received ({} foreign), {} sent{}; faults: {}\n", b.received, c.foreign, b.sent,
               b.send_drops == 0 ? ""
                                 : fmt::format(", {} not (no client, full queue or interface down)", b.send_drops),
               non_zero({{"receive overflow", b.receive_overflow},
                         {"malformed", b.malformed},
                         {"error frames", b.error_frames},
                         {"bus-off", b.bus_off},
                         {"connection or interface lost", b.interface_down}})) +
           (node.hub() && node.hub()->clients_left() > 0
                ? fmt::format("    clients that have come and gone: {}\n", node.hub()->clients_left())
                : "");
}

}  // namespace

std::vector<LatenessBin> lateness_bins(const SignedHistogram& late) {
    constexpr std::array kBounds{-30.0, -10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0, 30.0};
    std::vector<LatenessBin> bins;
    double from = -kInfinity;
    std::uint64_t before = 0;
    for (const double to : kBounds) {
        const std::uint64_t up_to = late.count_up_to(std::llround(to * 1e6));
        bins.push_back({std::exchange(from, to), to, up_to - std::exchange(before, up_to)});
    }
    bins.push_back({from, kInfinity, late.count() - before});
    return bins;
}

std::string against_deadline(double late_ms) {
    return fmt::format("{:.2f} ms {}", std::abs(late_ms), late_ms > 0 ? "after" : "before");
}

std::string lateness_text(const SignedHistogram& late) {
    std::string text;
    for (const auto& [from, to, frames] : lateness_bins(late)) {
        if (frames == 0) continue;
        const bool early = to <= 0;
        const double near = std::abs(early ? to : from), far = std::abs(early ? from : to);
        text += fmt::format("{}{} ", text.empty() ? "" : ", ", frames);
        text += std::isinf(far) ? fmt::format("over {:g} ms", near) : fmt::format("{:g} to {:g} ms", near, far);
        text += early ? " early" : " late";
    }
    return text.empty() ? "none" : text;
}

std::string CameraSensor::to_text(bool lockstep) const {
    const CameraStats& s = stats_;
    const auto late = [&](double p) { return against_deadline(s.late.percentile_ns(p) * 1e-6); };
    Counts steps;
    for (std::size_t i = 0; i < kStepNames.size(); ++i) steps.emplace_back(kStepNames[i], s.steps[i]);
    std::string out =
        fmt::format("  camera {}: {} frames, {} handed over, {}{} skipped, {}{} stale\n", name(), s.frames,
                    s.handed_over, s.not_taken > 0 ? fmt::format("{} taken by no sink, ", s.not_taken) : "",
                    s.skipped, lockstep ? "" : fmt::format("{} deadlines missed, ", s.deadline_missed), s.stale);
    out += fmt::format("    p50 / p99 / max: render {}", latency(s.render));
    if (!lockstep) {  // in lockstep there are no deadlines
        out += fmt::format("; mid-exposure to hand-over {}; wake-up latency {}", latency(s.hand_over),
                           latency(s.wake_late));
        out += fmt::format(
            "\n    hand-over, from the deadline: p50 {}, p90 {}, p99 {}, p99.9 {}, latest {}; repeated {}, blank "
            "{}\n"
            "    frames: {}",
            late(0.5), late(0.9), late(0.99), late(0.999), late(1), s.repeated, s.blanked, lateness_text(s.late));
    }
    out += "\n";
    out +=
        fmt::format("    steps: {}; samples per pixel p50 {:.2f}, max {:.2f} ({})", non_zero(steps),
                    s.samples_1e3.percentile_ns(0.5) * 1e-3, s.samples_1e3.max_ns() * 1e-3, kSamplesPerPixelNote);
    if (s.error_1e9.count() > 0)
        out += fmt::format("; expected error p50 {:.3g}, p99 {:.3g}, max {:.3g} of full scale",
                           s.error_1e9.percentile_ns(0.5) * 1e-9, s.error_1e9.percentile_ns(0.99) * 1e-9,
                           s.error_1e9.max_ns() * 1e-9);
    out += "\n";
    if (control_) {
        const CameraControlCounters c = control_->counters();
        out += fmt::format("    commands: {} accepted, {} refused; triggers: {} accepted, {} refused, {} dropped\n",
                           c.commands, c.commands_refused, c.triggers, c.triggers_refused, c.triggers_dropped);
    }
    for (const auto& sink : sinks_) {
        const VideoCounters c = sink->counters();
        out += fmt::format("    -> {}: {} written, {}\n", sink->description(), c.written,
                           dropped({{"ring full", c.ring_full}, {"no reader", c.no_reader}, {"failed", c.failed}}));
    }
    return out;
}

std::string LidarSensor::to_text(bool lockstep) const {
    const LidarStats& s = stats_;
    std::string out = fmt::format("  lidar {}: {} packets = {:.2f} sweeps, {} skipped, {} returns of {} shots\n",
                                  name(), s.packets, sweeps(), s.skipped, s.returns, s.shots);
    out += fmt::format("    p50 / p99 / max: fire {}", latency(s.fire));
    if (!lockstep)
        out +=
            fmt::format("; due to sent {}; {} late by more than a packet's period", latency(s.hand_over), s.late);
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

namespace {

constexpr double kAdvisedShare = 0.01;

double share(std::uint64_t part, std::uint64_t whole) {
    return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

/// Advice for a camera that did not keep up; empty: it did.
std::string advice(const CameraSensor& camera, const Camera& settings, std::int64_t budget_ns) {
    const CameraStats& s = camera.stats();
    const std::uint64_t due = s.frames + s.skipped;
    const double period_ms = static_cast<double>(settings.period_ns) * 1e-6;
    if (share(s.skipped + s.deadline_missed, due) <= kAdvisedShare) return {};
    const double needs_ms = s.render.percentile_ns(0.99) * 1e-6;  // includes the detector
    std::string text = fmt::format("camera {}: {} of {} frames were skipped and {} late. ", settings.name,
                                   s.skipped, due, s.deadline_missed);
    if (budget_ns > 0 && static_cast<double>(budget_ns) * 1e-6 < 0.9 * period_ms && s.skipped == 0)
        return text + "Give it more time (--budget-ms, at most the period), or less load beside it";
    return text + fmt::format(
                      "A frame takes {:.1f} ms (p99) and one is due every {:.1f} ms: expected --budget-ms {:.2g}, "
                      "fewer --spp or --budget-rays, or rate_hz at most {:.2g}",
                      needs_ms, period_ms, 0.6 * period_ms, std::max(0.1, 800 / std::max(needs_ms, 1e-3)));
}

/// The share of a camera's frames that a run may skip.
constexpr double kSkippedShareMost = 0.5;

bool kept_up(const Emulator& emulator) {
    for (const CameraSensor* c : emulator.sensors_of<CameraSensor>())
        if (share(c->stats().skipped, c->stats().frames + c->stats().skipped) > kSkippedShareMost) return false;
    return true;
}

/// False where a sensor of another kind may have made something.
bool made_nothing(const Emulator& emulator) {
    const auto cameras = emulator.sensors_of<CameraSensor>();
    const auto lidars = emulator.sensors_of<LidarSensor>();
    return cameras.size() + lidars.size() == emulator.sensors().size() &&
           std::ranges::all_of(cameras, [](const auto* c) { return c->stats().frames == 0; }) &&
           std::ranges::all_of(lidars, [](const auto* l) { return l->stats().packets == 0; });
}

/// Stopping a run that waits for its first command is no failure. A run that was commanded, but not for all of its
/// bodies, could not begin and has failed.
bool stopped_while_waiting(const Emulator& emulator) {
    return emulator.stopped() &&
           (emulator.bodies_without_a_pose().empty() || emulator.can()->bus().counters().received == 0);
}

/// Why a lockstep run has made no item.
std::string why_nothing(const Emulator& emulator) {
    const std::string bodies = emulator.bodies_without_a_pose();
    if (bodies.empty())
        return fmt::format(
            "no frame and no packet was made: none was due by {:.6f} s, where the commands or the duration end",
            static_cast<double>(emulator.t_ns()) * 1e-9);
    const std::uint64_t foreign = emulator.can()->counters().foreign;
    return fmt::format(
        "no pose command was accepted for {}{}; a lockstep run begins when every body with a can_id has "
        "a pose",
        bodies, foreign > 0 ? fmt::format("; {} frames had other identifiers", foreign) : "");
}

}  // namespace

std::vector<std::string> failures(const Emulator& emulator) {
    std::vector<std::string> all;
    if (!kept_up(emulator))
        all.push_back(fmt::format("a camera skipped more than {:g} % of its frames", 100 * kSkippedShareMost));
    if (emulator.options().lockstep && made_nothing(emulator) && !stopped_while_waiting(emulator))
        all.push_back(why_nothing(emulator));
    return all;
}

std::vector<std::string> advice(const Emulator& emulator) {
    std::vector<std::string> all;
    const Scene& scene = emulator.world().scene();
    for (const CameraSensor* c : emulator.sensors_of<CameraSensor>())
        for (const Camera& settings : scene.cameras)
            if (settings.name == c->name())
                if (std::string text = advice(*c, settings, scene.render.budget_ns); !text.empty())
                    all.push_back(std::move(text));
    return all;
}

std::string to_text(const Emulator& emulator) {
    const bool lockstep = emulator.options().lockstep;
    std::string out = fmt::format("{}: {:.3f} s in {}\n", emulator.world().scene().name,
                                  static_cast<double>(emulator.t_ns()) * 1e-9, lockstep ? "lockstep" : "real time");
    for (const auto& sensor : emulator.sensors()) out += sensor->to_text(lockstep);
    if (const OnlineEstimator* e = emulator.estimator())
        out += fmt::format("  estimate of {} from camera {}: {} frames skipped; {}", e->target(), e->camera().name,
                           e->skipped(), to_text(summarise(e->frames())));
    if (emulator.can()) out += bus_text(*emulator.can());
    if (!lockstep)
        out += fmt::format("  page faults while running: {} minor, {} major\n", emulator.page_faults().minor,
                           emulator.page_faults().major);
    for (const std::string& notice : emulator.notices()) out += "  note: " + notice + "\n";
    for (const std::string& text : advice(emulator)) out += "  advice: " + text + "\n";
    for (const std::string& text : failures(emulator)) out += "  failed: " + text + "\n";
    if (!emulator.options().log_folder.empty()) out += "  log: " + emulator.options().log_folder + "\n";
    return out;
}

}  // namespace narpa
