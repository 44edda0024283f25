// The statistics of a run as JSON and as text.
#include "emulator/report.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "drivers/can/redundant_bus.h"

namespace narpa {

using nlohmann::json;

namespace {

/// Of two redundant buses; an empty list for one.
json buses_document(const CanBus& bus) {
    json all = json::array();
    for (const BusUse& use : bus.uses())
        all.push_back({{"bus", use.bus},
                       {"frames_received", use.counters.received},
                       {"frames_used", use.used},
                       {"duplicates", use.duplicates},
                       {"while_not_in_use", use.idle},
                       {"frames_sent", use.counters.sent},
                       {"send_drops", use.counters.send_drops},
                       {"interface_down", use.counters.interface_down}});
    return all;
}

json bus_document(const CanNode& node) {
    const CommandCounters c = node.counters();
    const CanCounters& b = node.bus().counters();
    return {{"bus", node.bus().description()},
            {"frames_received", b.received},
            {"frames_sent", b.sent},
            {"send_drops", b.send_drops},
            {"receive_overflow", b.receive_overflow},
            {"malformed", b.malformed},
            {"not_carried", b.not_carried},
            {"error_frames", b.error_frames},
            {"bus_off", b.bus_off},
            {"interface_down", b.interface_down},
            {"clients_left", node.hub() ? json(node.hub()->clients_left()) : json(nullptr)},
            {"foreign_frames", c.foreign},
            {"frames_not_logged", c.not_logged},
            {"commands_taken", c.taken},
            {"commands_missed", c.missed},
            {"rejected", to_json(c.rejected())},
            {"buses", buses_document(node.bus())},
            {"switches", node.bus().switches()}};
}

std::string buses_text(const CanBus& bus) {
    std::string text;
    for (const BusUse& use : bus.uses())
        text += fmt::format("    {}: {} frames used, {} as duplicates or not in use, {} sent; faults: {}\n",
                            use.bus, use.used, use.duplicates + use.idle, use.counters.sent,
                            non_zero({{"not sent", use.counters.send_drops},
                                      {"connection or interface lost", use.counters.interface_down}}));
    if (bus.switches() > 0) text += fmt::format("    the other bus was taken into use {} times\n", bus.switches());
    return text;
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
                         {"CAN XL, which is not carried", b.not_carried},
                         {"error frames", b.error_frames},
                         {"bus-off", b.bus_off},
                         {"connection or interface lost", b.interface_down}})) +
           buses_text(node.bus()) +
           (node.hub() && node.hub()->clients_left() > 0
                ? fmt::format("    clients that have come and gone: {}\n", node.hub()->clients_left())
                : "");
}

std::string utc_text(std::int64_t unix_ns) {
    return fmt::format("{:%Y-%m-%dT%H:%M:%S}Z",
                       std::chrono::sys_time<std::chrono::nanoseconds>(std::chrono::nanoseconds(unix_ns)));
}

json clock_document(const Emulator& emulator) {
    const RunUtc& utc = emulator.utc();
    json clock{
        {"source", TimeSettings::kSourceNames[static_cast<std::size_t>(emulator.world().scene().time.source)]},
        {"utc_of_zero", utc_text(utc.zero_unix_ns)},
        {"utc_of_zero_unix_ns", utc.zero_unix_ns}};
    if (const SystemUtc* system = emulator.system_utc()) {
        const ClockDiscipline d = read_clock_discipline();
        const auto seconds = [](std::int64_t ns) {
            return ns < 0 ? json(nullptr) : json(1e-9 * static_cast<double>(ns));
        };
        clock["synchronised"] = utc.synchronised;
        clock["error_s"] = seconds(utc.error_ns);
        clock["error_max_s"] = seconds(d.error_max_ns);
        clock["frequency_ppm"] = 1e-3 * static_cast<double>(d.frequency_ppb);
        clock["tai_less_utc_s"] = d.tai_less_utc_s;
        clock["steps"] = system->steps();
        clock["last_step_s"] = 1e-9 * static_cast<double>(system->last_step_ns());
        clock["ptp4l"] = to_json(emulator.ptp4l()->report());
    }
    return clock;
}

std::string clock_text(const Emulator& emulator) {
    if (!emulator.system_utc()) return {};
    const RunUtc& utc = emulator.utc();
    return fmt::format("  clock: the system's UTC, time 0 is {}, {}\n    ptp4l: {}\n", utc_text(utc.zero_unix_ns),
                       utc.synchronised ? "synchronised, " + error_text(utc.error_ns) : "not synchronised",
                       to_text(emulator.ptp4l()->report()));
}

json triggers_document(const Emulator& emulator) {
    json all = json::array();
    for (const auto& source : emulator.triggers())
        all.push_back({{"source", source->description()},
                       {"pulses_received", source->counters().received},
                       {"pulses_lost", source->counters().lost}});
    return all;
}

json second_pulses_document(const SecondPulses* pulses) {
    if (pulses == nullptr) return nullptr;
    return {{"line", pulses->description()},
            {"pulses", pulses->late().count()},
            {"failed", pulses->failed()},
            {"late_us", percentiles(pulses->late(), 1e-3)}};
}

std::string pulses_text(const Emulator& emulator) {
    std::string text;
    for (const auto& source : emulator.triggers())
        text += fmt::format("  triggers, {}: {} pulses{}\n", source->description(), source->counters().received,
                            source->counters().lost > 0 ? fmt::format(", {} lost", source->counters().lost) : "");
    if (const SecondPulses* pulses = emulator.second_pulses())
        text += fmt::format("  pulse per second, {}: {} pulses, late by {}{}\n", pulses->description(),
                            pulses->late().count(), latency_text(pulses->late()),
                            pulses->failed() > 0 ? fmt::format("; {} failed", pulses->failed()) : "");
    return text;
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

bool made_nothing(const Emulator& emulator) {
    return std::ranges::all_of(emulator.sensors(), [](const auto& s) { return s->made() == 0; });
}

}  // namespace

json report(const Emulator& emulator) {
    json document{
        {"clock", clock_document(emulator)},
        {"triggers", triggers_document(emulator)},
        {"second_pulses", second_pulses_document(emulator.second_pulses())},
        {"scene", emulator.world().scene().name},
        {"mode", emulator.options().lockstep ? "lockstep" : "real time"},
        {"simulated_s", static_cast<double>(emulator.t_ns()) * 1e-9},
        {"can", emulator.can() ? bus_document(*emulator.can()) : json(nullptr)},
        {"page_faults", {{"minor", emulator.page_faults().minor}, {"major", emulator.page_faults().major}}},
        {"notices", emulator.notices()},
        {"advice", advice(emulator)},
        {"failures", failures(emulator)},
        {"passed", failures(emulator).empty()},
        {"log", emulator.options().log_folder},
        {"mcap", emulator.mcap() ? emulator.mcap()->report() : json(nullptr)}};
    for (const SensorKind& kind : emulator.kinds()) document[std::string(kind.name) + "s"] = json::array();
    for (const auto& feed : emulator.observers())
        document[std::string(feed->observer().name())] = feed->observer().report(feed->skipped());
    for (const auto& sensor : emulator.sensors())
        document[std::string(sensor->kind()) + "s"].push_back(sensor->report());
    return document;
}

std::vector<std::string> failures(const Emulator& emulator) {
    std::vector<std::string> all;
    for (const auto& sensor : emulator.sensors())
        if (std::string text = sensor->failure(); !text.empty() && std::ranges::find(all, text) == all.end())
            all.push_back(std::move(text));
    if (emulator.options().lockstep && made_nothing(emulator) && !stopped_while_waiting(emulator))
        all.push_back(why_nothing(emulator));
    if (emulator.abandoned())
        all.push_back(
            fmt::format("the last client that sent commands left at {:.3f} s, expected at {:g} s, the end",
                        static_cast<double>(emulator.t_ns()) * 1e-9, emulator.options().duration_s));
    return all;
}

std::vector<std::string> advice(const Emulator& emulator) {
    std::vector<std::string> all;
    for (const auto& sensor : emulator.sensors())
        if (std::string text = sensor->advice(); !text.empty()) all.push_back(std::move(text));
    return all;
}

std::string to_text(const Emulator& emulator) {
    const bool lockstep = emulator.options().lockstep;
    std::string out = fmt::format("{}: {:.3f} s in {}\n", emulator.world().scene().name,
                                  static_cast<double>(emulator.t_ns()) * 1e-9, lockstep ? "lockstep" : "real time");
    for (const auto& sensor : emulator.sensors()) out += sensor->to_text(lockstep);
    for (const auto& feed : emulator.observers()) out += feed->observer().to_text(feed->skipped());
    if (emulator.can()) out += bus_text(*emulator.can());
    out += clock_text(emulator);
    out += pulses_text(emulator);
    if (!lockstep)
        out += fmt::format("  page faults while running: {} minor, {} major\n", emulator.page_faults().minor,
                           emulator.page_faults().major);
    for (const std::string& notice : emulator.notices()) out += "  note: " + notice + "\n";
    for (const std::string& text : advice(emulator)) out += "  advice: " + text + "\n";
    for (const std::string& text : failures(emulator)) out += "  failed: " + text + "\n";
    if (emulator.mcap()) out += emulator.mcap()->to_text();
    if (!emulator.options().log_folder.empty()) out += "  log: " + emulator.options().log_folder + "\n";
    return out;
}

}  // namespace narpa
