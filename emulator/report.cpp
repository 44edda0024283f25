#include "emulator/report.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "emulator/log/estimate_report.h"

namespace narpa {
namespace {

using nlohmann::json;

json percentiles_ms(const Histogram& h) {
    return {
        {"p50", h.percentile_ns(0.5) * 1e-6}, {"p99", h.percentile_ns(0.99) * 1e-6}, {"max", h.max_ns() * 1e-6}};
}

template <class H>
json percentiles(const H& h, double unit) {
    return {{"p50", h.percentile_ns(0.5) * unit},
            {"p90", h.percentile_ns(0.9) * unit},
            {"p99", h.percentile_ns(0.99) * unit},
            {"p99.9", h.percentile_ns(0.999) * unit},
            {"max", h.max_ns() * unit}};
}

/// Bounds of the bins of lateness, ms.
constexpr std::array kBins{-30.0, -10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0, 30.0};

/// Frames that got so far, by the names of the steps.
json of_steps(const CameraStats& s) {
    json steps = json::object();
    for (std::size_t i = 0; i < kStepNames.size(); ++i) steps[std::string(kStepNames[i])] = s.steps[i];
    return steps;
}

json of_camera(const CameraFeed& feed) {
    const CameraStats& s = feed.stats();
    json sinks = json::array();
    for (const auto& sink : feed.sinks()) {
        const VideoCounters c = sink->counters();
        sinks.push_back({{"sink", sink->description()},
                         {"written", c.written},
                         {"dropped_ring_full", c.ring_full},
                         {"dropped_no_reader", c.no_reader},
                         {"dropped_failed", c.failed},
                         {"reconnects", c.reconnects}});
    }
    return {{"name", feed.unit().camera().name},
            {"frames", s.frames},
            {"handed_over", s.handed_over},
            {"skipped", s.skipped},
            {"deadlines_missed", s.deadline_missed},
            {"stale", s.stale},
            {"ledgers_lost", s.ledgers_lost},
            {"repeated", s.repeated},
            {"blanked", s.blanked},
            {"steps", of_steps(s)},
            {"samples_per_pixel", percentiles(s.samples_1e3, 1e-3)},
            {"expected_error", s.error_1e9.count() > 0 ? percentiles(s.error_1e9, 1e-9) : json(nullptr)},
            {"hand_over_after_deadline_ms", lateness(s.late)},
            {"wake_late_ms", percentiles_ms(s.wake_late)},
            {"render_ms", percentiles_ms(s.render)},
            {"mid_exposure_to_hand_over_ms", percentiles_ms(s.hand_over)},
            {"sinks", sinks}};
}

json of_lidar(const LidarFeed& feed) {
    const LidarStats& s = feed.stats();
    json sinks = json::array();
    for (const auto& sink : feed.sinks()) {
        const PacketCounters c = sink->counters();
        sinks.push_back({{"sink", sink->description()}, {"sent", c.sent}, {"dropped", c.dropped}});
    }
    return {{"name", feed.unit().lidar().name},
            {"packets", s.packets},
            {"sweeps", feed.sweeps()},
            {"skipped", s.skipped},
            {"shots", s.shots},
            {"returns", s.returns},
            {"wake_late_ms", percentiles_ms(s.wake_late)},
            {"fire_ms", percentiles_ms(s.fire)},
            {"due_to_sent_ms", percentiles_ms(s.hand_over)},
            {"sinks", sinks}};
}

json of_estimates(const EstimateFeed& feed) {
    return {{"camera", feed.camera().name},
            {"target", feed.target()},
            {"passed_over", feed.passed_over()},
            {"summary", to_json(summarise(feed.frames()))}};
}

json of_bus(CanNode& node) {
    const CommandCounters c = node.counters();
    const CanCounters& b = node.bus().counters();
    json rejected = {{"past", c.past}, {"overrun", c.overrun}};
    for (std::size_t i = 0; i < kDecodeStatusCount; ++i) {
        const auto status = static_cast<DecodeStatus>(i);
        const bool good =
            status == DecodeStatus::not_mine || status == DecodeStatus::partial || status == DecodeStatus::complete;
        if (!good) rejected[std::string(name(status))] = c.by_status[i];
    }
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

std::string latency(const json& p) {
    return fmt::format("{:.2f} / {:.2f} / {:.2f} ms", p["p50"].get<double>(), p["p99"].get<double>(),
                       p["max"].get<double>());
}

/// "3 bad_checksum, 1 past", or "none".
std::string non_zero(const json& counts) {
    std::string text;
    for (const auto& [key, n] : counts.items())
        if (n.get<std::uint64_t>() > 0)
            text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n.get<std::uint64_t>(), key);
    return text.empty() ? "none" : text;
}

std::uint64_t number(const json& j, const char* key) {
    return j[key].get<std::uint64_t>();
}

}  // namespace

json lateness(const SignedHistogram& late) {
    json out = percentiles(late, 1e-6), bins = json::array();
    std::uint64_t before = 0;
    for (const double end_ms : kBins) {
        const std::uint64_t seen = late.count_up_to(std::llround(end_ms * 1e6));
        bins.push_back({{"up_to_ms", end_ms}, {"frames", seen - before}});
        before = seen;
    }
    bins.push_back({{"up_to_ms", nullptr}, {"frames", late.count() - before}});
    out["bins"] = bins;
    return out;
}

std::string lateness_in_words(const json& lateness) {
    std::string text;
    const json& bins = lateness["bins"];
    for (std::size_t i = 0; i < bins.size(); ++i) {
        if (number(bins[i], "frames") == 0) continue;
        const double from = i > 0 ? kBins[i - 1] : kBins[0], to = i < kBins.size() ? kBins[i] : kBins.back();
        const bool early = to <= 0;
        const double near = std::abs(early ? to : from), far = std::abs(early ? from : to);
        text += fmt::format("{}{} ", text.empty() ? "" : ", ", number(bins[i], "frames"));
        text += near == far ? fmt::format("over {:g} ms", near) : fmt::format("{:g} to {:g} ms", near, far);
        text += early ? " early" : " late";
    }
    return text.empty() ? "none" : text;
}

json report(Emulator& emulator) {
    json cameras = json::array(), lidars = json::array();
    for (const auto& feed : emulator.cameras()) cameras.push_back(of_camera(*feed));
    for (const auto& feed : emulator.lidars()) lidars.push_back(of_lidar(*feed));
    return {{"scene", emulator.world().scene().name},
            {"mode", emulator.options().lockstep ? "lockstep" : "real time"},
            {"simulated_s", static_cast<double>(emulator.t_ns()) * 1e-9},
            {"cameras", cameras},
            {"lidars", lidars},
            {"estimate", emulator.estimates() ? of_estimates(*emulator.estimates()) : json(nullptr)},
            {"can", emulator.can() ? of_bus(*emulator.can()) : json(nullptr)},
            {"page_faults", {{"minor", emulator.page_faults().minor}, {"major", emulator.page_faults().major}}},
            {"notices", emulator.notices()},
            {"log", emulator.options().log_folder}};
}

std::string in_words(const json& r) {
    std::string out = fmt::format("{}: {:.3f} s in {}\n", r["scene"].get<std::string>(),
                                  r["simulated_s"].get<double>(), r["mode"].get<std::string>());
    for (const json& c : r["cameras"]) {
        out += fmt::format("  camera {}: {} frames, {} handed over, {} skipped, {} deadlines missed, {} stale\n",
                           c["name"].get<std::string>(), number(c, "frames"), number(c, "handed_over"),
                           number(c, "skipped"), number(c, "deadlines_missed"), number(c, "stale"));
        out += fmt::format("    p50 / p99 / max: render {}; mid-exposure to hand-over {}; woken late {}\n",
                           latency(c["render_ms"]), latency(c["mid_exposure_to_hand_over_ms"]),
                           latency(c["wake_late_ms"]));
        const json& late = c["hand_over_after_deadline_ms"];
        out += fmt::format(
            "    hand-over after the deadline: p50 {:.2f}, p90 {:.2f}, p99 {:.2f}, p99.9 {:.2f}, max {:.2f} ms; "
            "repeated {}, blank {}\n    frames: {}\n",
            late["p50"].get<double>(), late["p90"].get<double>(), late["p99"].get<double>(),
            late["p99.9"].get<double>(), late["max"].get<double>(), number(c, "repeated"), number(c, "blanked"),
            lateness_in_words(late));
        const json &spp = c["samples_per_pixel"], &error = c["expected_error"];
        out += fmt::format("    steps: {}; samples per pixel p50 {:.2f}, max {:.2f}", non_zero(c["steps"]),
                           spp["p50"].get<double>(), spp["max"].get<double>());
        if (!error.is_null())
            out += fmt::format("; expected error p50 {:.3g}, p99 {:.3g}, max {:.3g} of full scale",
                               error["p50"].get<double>(), error["p99"].get<double>(), error["max"].get<double>());
        out += "\n";
        for (const json& s : c["sinks"]) {
            const json drops = {{"ring full", s["dropped_ring_full"]},
                                {"no reader", s["dropped_no_reader"]},
                                {"failed", s["dropped_failed"]}};
            out += fmt::format("    -> {}: {} written, dropped: {}\n", s["sink"].get<std::string>(),
                               number(s, "written"), non_zero(drops));
        }
    }
    for (const json& l : r["lidars"]) {
        out += fmt::format("  lidar {}: {} packets = {:.2f} sweeps, {} skipped, {} returns of {} shots\n",
                           l["name"].get<std::string>(), number(l, "packets"), l["sweeps"].get<double>(),
                           number(l, "skipped"), number(l, "returns"), number(l, "shots"));
        out += fmt::format("    p50 / p99 / max: fire {}; due to sent {}\n", latency(l["fire_ms"]),
                           latency(l["due_to_sent_ms"]));
        for (const json& s : l["sinks"])
            out += fmt::format("    -> {}: {} sent, {} dropped\n", s["sink"].get<std::string>(), number(s, "sent"),
                               number(s, "dropped"));
    }
    if (const json& e = r["estimate"]; !e.is_null())
        out += fmt::format("  estimate of {} from camera {}: {} frames passed over; {}",
                           e["target"].get<std::string>(), e["camera"].get<std::string>(), number(e, "passed_over"),
                           estimates_in_words(e["summary"]));
    if (const json& b = r["can"]; !b.is_null()) {
        out += fmt::format("  can {}: {} commands taken, {} missed, rejected: {}\n", b["bus"].get<std::string>(),
                           number(b, "commands_taken"), number(b, "commands_missed"), non_zero(b["rejected"]));
        const json trouble = {{"receive overflow", b["receive_overflow"]},
                              {"malformed", b["malformed"]},
                              {"error frames", b["error_frames"]},
                              {"bus-off", b["bus_off"]},
                              {"connection or interface lost", b["interface_down"]}};
        out += fmt::format("    {} frames received ({} foreign), {} sent, {} that nobody took; trouble: {}\n",
                           number(b, "frames_received"), number(b, "foreign_frames"), number(b, "frames_sent"),
                           number(b, "send_drops"), non_zero(trouble));
    }
    if (const json& f = r["page_faults"]; r["mode"] == "real time")
        out += fmt::format("  page faults while running: {} minor, {} major\n", f["minor"].get<std::int64_t>(),
                           f["major"].get<std::int64_t>());
    for (const json& n : r["notices"]) out += "  note: " + n.get<std::string>() + "\n";
    if (!r["log"].get<std::string>().empty()) out += "  log: " + r["log"].get<std::string>() + "\n";
    return out;
}

}  // namespace narpa
