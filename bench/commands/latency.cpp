// narpa bench latency - latency of commands over each bus, of frames through each sink, and of LiDAR packets.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "bench/commands/commands.h"
#include "bench/latency.h"
#include "rehearsal/runner/free_port.h"

namespace narpa::cli {
namespace {

struct LatencyBenchOptions {
    std::vector<std::string> buses, sinks;
    std::string size = "640x480", format = "GREY";
    double pause_s = 0.005;
    LatencySettings settings;
};

/// Model name of the processor.
std::string machine_name() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);)
        if (const std::size_t colon = line.find(": "); line.starts_with("model name") && colon != std::string::npos)
            return line.substr(colon + 2);
    return "unknown processor";
}

Status read_format(const LatencyBenchOptions& o, VideoFormat& format) {
    int width = 0, height = 0, end = 0;
    const bool is_size = std::sscanf(o.size.c_str(), "%5dx%5d%n", &width, &height, &end) == 2;
    if (!is_size || static_cast<std::size_t>(end) != o.size.size() || width <= 0 || height <= 0)
        return Error{"--size " + o.size + ": expected WIDTHxHEIGHT, like 640x480"};
    const auto pixel = pixel_format_from(o.format);
    if (!pixel)
        return Error{"--format " + o.format + ": expected " +
                     fmt::format("{}", fmt::join(kPixelFormatNames, ", "))};
    format.width = width, format.height = height, format.pixel = *pixel;
    return Ok{};
}

/// Temporary folder, removed by the destructor.
struct WorkFolder {
    std::string path;
    WorkFolder() : path((std::filesystem::temp_directory_path() / "narpa-latency-XXXXXX").string()) {
        if (::mkdtemp(path.data()) == nullptr) path.clear();
    }
    WorkFolder(const WorkFolder&) = delete;
    WorkFolder& operator=(const WorkFolder&) = delete;
    ~WorkFolder() {
        std::error_code none;
        if (!path.empty()) std::filesystem::remove_all(path, none);
    }
};

Result<std::vector<LatencyRow>> measure_ways(const LatencyBenchOptions& o, bool measures_packets) {
    std::vector<LatencyRow> rows;
    Progress progress("measuring");
    for (const std::string& bus : o.buses) {
        progress.show(bus);
        auto of_bus = measure_bus(bus, o.settings, stop_flag());
        if (!of_bus) return of_bus.error();
        std::move(of_bus->begin(), of_bus->end(), std::back_inserter(rows));
    }
    for (const std::string& sink : o.sinks) {
        progress.show(sink);
        auto row = measure_sink(sink, o.settings, stop_flag());
        if (!row) return row.error();
        rows.push_back(*std::move(row));
    }
    if (!measures_packets || stop_flag()) return rows;
    progress.show("udp");
    const auto port = rehearsal::free_lidar_port();
    if (!port) return port.error();
    auto row = measure_packets(static_cast<std::uint16_t>(*port), o.settings, stop_flag());
    if (!row) return row.error();
    rows.push_back(*std::move(row));
    return rows;
}

Outcome bench_latency(LatencyBenchOptions o) {
    stop_on_signals();
    if (auto good = read_format(o, o.settings.format); !good) return good.error();
    o.settings.pause_ns = static_cast<std::int64_t>(o.pause_s * 1e9);
    const WorkFolder folder;
    const bool is_default = o.buses.empty() && o.sinks.empty();
    if (is_default) {
        if (folder.path.empty()) return Error{.what = "cannot make a temporary folder", .kind = ErrorKind::failed};
        o.buses = {"slcan:0", "udp:239.74.163.2"};
        const auto port = rehearsal::free_lidar_port();
        if (!port) return port.error();
        o.sinks = {folder.path + "/fifo", folder.path + "/frames.y4m", fmt::format("udp:127.0.0.1:{}", *port)};
    }
    auto rows = measure_ways(o, is_default);
    if (!rows) return rows.error();
    const std::string machine = machine_name();
    say(fmt::format("{}; from the call that hands it over to the call that has it whole", machine));
    say(to_text(*rows));
    if (stop_flag()) say("interrupted before the end");
    nlohmann::json of_rows = nlohmann::json::array();
    for (const LatencyRow& row : *rows) of_rows.push_back(to_json(row));
    return nlohmann::json{{"passed", !stop_flag()}, {"machine", machine}, {"rows", of_rows}};
}

}  // namespace

Command add_bench_latency(Parser bench_command) {
    auto o = std::make_shared<LatencyBenchOptions>();
    const Parser c = bench_command.subcommand(
        "latency", "How long pose commands need over a bus, frames through a sink, LiDAR packets over UDP");
    c.option(
         "--can", o->buses,
         "BUS as of `narpa run`, or BUS=BUS where the commander is on another, like usb:=vcan0; may be given many "
         "times")
        .type_name("BUS")
        .repeatable();
    c.option("--video", o->sinks,
             "SINK as of `narpa run`, read by the bench itself: /dev/videoN, a FIFO, FILE.y4m, udp:127.0.0.1:PORT, "
             "rtp:127.0.0.1:PORT; uvc:PORT and bulk: are attached to this machine, with a bridge in software "
             "(vhci-hcd, root); may be "
             "given many "
             "times")
        .type_name("SINK")
        .repeatable();
    c.option("--size", o->size, "Size of the frames").type_name("WIDTHxHEIGHT").shows_default();
    c.option("--format", o->format, "Of their pixels").shows_default();
    c.option("--count", o->settings.count, "How many are measured of each").range(1, 1000000).shows_default();
    c.option("--pause", o->pause_s, "Between an arrival and the next")
        .type_name("SECONDS")
        .range(0.0, 60.0)
        .shows_default();
    c.footer("Without --can and --video: slcan, UDP multicast, a FIFO, a file, frames and LiDAR packets over UDP.");
    c.examples({"narpa bench latency",
                "narpa bench latency --can vcan0 --can usb:=vcan0 --video /dev/video10 --video bulk:"});
    return [o] { return bench_latency(*o); };
}

}  // namespace narpa::cli
