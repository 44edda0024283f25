#include "apps/commands/sweep_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "drivers/lidar/capture.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa::cli {
namespace {

using Counts = std::map<std::string, std::uint64_t>;

/// "12 of 1248 bytes to port 2368, ...": the most frequent ones. `separator`: between the number and what it
/// counts.
std::string text_of(const Counts& counts, const char* separator = " ") {
    constexpr std::size_t kShown = 4;
    std::vector<std::pair<std::string, std::uint64_t>> all(counts.begin(), counts.end());
    std::ranges::stable_sort(all, std::ranges::greater{}, [](const auto& c) { return c.second; });
    std::string text;
    for (std::size_t i = 0; i < std::min(all.size(), kShown); ++i)
        text += fmt::format("{}{}{}{}", text.empty() ? "" : ", ", all[i].second, separator, all[i].first);
    if (all.size() > kShown) text += ", ...";
    return text;
}

/// What of the capture's frames was lost; empty: nothing.
std::string losses_of(const CaptureCounters& c) {
    std::string text;
    const auto add = [&](std::uint64_t n, const char* what) {
        if (n > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, what);
    };
    add(c.cut, "frames captured in part only (snapshot length)");
    add(c.malformed, "frames whose lengths contradict each other");
    add(c.incomplete, "datagrams with missing fragments");
    add(c.repeated, "captured more than once");
    return text;
}

struct Packet {
    std::int64_t t_ns = 0;  ///< as stated in it
    const UdpDatagram* datagram = nullptr;
};

bool is_of(const std::string& unit, const std::string& chosen) {
    return unit == chosen || unit.starts_with(chosen + ":");
}

/// The data packets of the unit, in the capture's order, with counts of the others.
std::vector<Packet> packets_of(const Capture& capture, const LidarModel& unit, const std::string& chosen,
                               Counts& units, CapturedSweep& out) {
    std::vector<Packet> packets;
    std::int64_t first_ns = 0, first_captured_ns = 0;
    for (const UdpDatagram& d : capture.datagrams) {
        if (d.payload.size() != unit.spec().data_packet_bytes) {
            ++out.other_size[fmt::format("of {} bytes to port {}", d.payload.size(), d.port)];
            continue;
        }
        const std::int64_t near_ns = packets.empty() ? 0 : first_ns + d.t_ns - first_captured_ns;
        const auto t_ns = unit.packet_time(d.payload, near_ns);
        if (!t_ns) {
            ++out.refused[unit.mismatch(d.payload)];
            continue;
        }
        const std::string of = fmt::format("{}:{}", d.source, d.port);
        if (!chosen.empty() && !is_of(of, chosen)) {
            ++out.other_unit[of];
            continue;
        }
        ++units[of];
        if (packets.empty()) first_ns = *t_ns, first_captured_ns = d.t_ns;
        packets.push_back({*t_ns, &d});
    }
    return packets;
}

Error no_packet(const std::string& path, const LidarModel& unit, const std::string& chosen,
                const CapturedSweep& found) {
    const LidarSpec& spec = unit.spec();
    std::string text = found.refused.empty() && found.other_unit.empty()
                           ? fmt::format("holds no UDP datagram of {} bytes, expected those of a {}",
                                         spec.data_packet_bytes, spec.name)
                           : fmt::format("holds no data packet of {}, expected at least one",
                                         chosen.empty() ? fmt::format("this {}", spec.name) : chosen);
    const auto add = [&](const char* what, const std::string& list) {
        if (!list.empty()) text += fmt::format("; {}{}", what, list);
    };
    add("datagrams: ", text_of(found.other_unit, " from "));
    add("datagrams: ", text_of(found.refused, ": "));
    if (found.refused.empty()) add("datagrams: ", text_of(found.other_size));
    add("dropped: ", losses_of(found.capture));
    add("", found.cut);
    return Error{text, path};
}

/// Counts that say that something is wrong with the capture, or with what it was taken for.
std::vector<std::string> warnings_of(const std::string& path, const std::vector<Packet>& packets,
                                     const CapturedSweep& s) {
    std::vector<std::string> warnings;
    const auto add = [&](const std::string& what, const std::string& list) {
        if (!list.empty()) warnings.push_back(fmt::format("{}: {}{}", path, what, list));
    };
    const std::string to_port = fmt::format("to port {}", packets.front().datagram->port);
    Counts strange;
    for (const auto& [what, n] : s.other_size)
        if (what.ends_with(to_port)) strange[what] = n;
    add("cut short, what is whole is used: ", s.cut);
    add("dropped: ", losses_of(s.capture));
    add("datagrams that are no data packets of this LiDAR: ", text_of(s.refused, ": "));
    add("datagrams that are not as long as its data packets: ", text_of(strange));
    return warnings;
}

}  // namespace

Result<CapturedSweep> read_sweep(const std::string& path, const LidarModel& unit, const std::string& chosen) {
    const auto capture = read_capture(path);
    if (!capture) return capture.error();
    CapturedSweep out;
    out.capture = capture->counters;
    out.cut = capture->cut;
    Counts units;
    std::vector<Packet> packets = packets_of(*capture, unit, chosen, units, out);
    if (packets.empty()) return no_packet(path, unit, chosen, out);
    if (units.size() > 1) {
        std::string names;
        for (const auto& [name, n] : units) names += (names.empty() ? "" : ", ") + name;
        return Error{
            fmt::format("data packets of {} units: {}; choose one with --unit ADDRESS:PORT", units.size(), names),
            path};
    }

    const std::int64_t turn_ns = std::llround(1e9 / unit.spec().rate_hz);
    std::int64_t begin_ns = packets.front().t_ns;
    for (const Packet& p : packets)
        if (packets.front().t_ns - p.t_ns < turn_ns) begin_ns = std::min(begin_ns, p.t_ns);
    std::ranges::stable_sort(packets, {}, &Packet::t_ns);
    SweepReader reader(unit);
    for (const Packet& p : packets) {
        const bool in_turn = p.t_ns >= begin_ns && p.t_ns - begin_ns < turn_ns;
        ++(in_turn ? out.used : out.later);
        if (in_turn) reader.append(p.datagram->payload, p.t_ns - begin_ns, out.sweep);
    }
    out.warnings = warnings_of(path, packets, out);
    return out;
}

nlohmann::json to_json(const CapturedSweep& s) {
    const CaptureCounters& c = s.capture;
    return {{"frames", c.frames},
            {"other_traffic", c.other},
            {"cut_frames", c.cut},
            {"malformed", c.malformed},
            {"repeated", c.repeated},
            {"incomplete", c.incomplete},
            {"used", s.used},
            {"other_turns", s.later},
            {"refused", s.refused},
            {"other_size", s.other_size},
            {"other_unit", s.other_unit},
            {"cut_short", s.cut.empty() ? nlohmann::json(nullptr) : nlohmann::json(s.cut)}};
}

}  // namespace narpa::cli
