// narpa scan - what one LiDAR measures during a turn (or longer), as a point cloud, a table of shots or a capture.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <vector>

#include "apps/cli.h"
#include "apps/commands/cloud_file.h"
#include "apps/outputs.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "base/time.h"
#include "base/write_file.h"
#include "drivers/lidar/packet_sink.h"
#include "emulator/lidar/lidar_unit.h"
#include "emulator/log/sweep_log.h"

namespace narpa::cli {
namespace {

struct ScanOptions {
    SceneArgument scene;
    std::string lidar, out;
    PoseOptions pose;
    double time_s = 0, duration_s = 0;
};

/// An output file: receives every packet, then is closed.
using Writer = std::function<void(std::int64_t packet, LidarUnit& unit)>;

/// The lines of the packet's returns: x, y, z in the LiDAR's frame, reflectivity.
void add_points(const LidarUnit& unit, std::vector<std::string>& lines) {
    for (std::size_t i = 0; i < unit.shots().size(); ++i)
        for (const LidarEcho& e : unit.echoes()[i].reported(unit.spec().returns)) {
            const Vec3f p = vec_cast<float>(unit.shots()[i].origin_m + e.range_m * unit.shots()[i].direction);
            if (e.range_m > 0) lines.push_back(fmt::format("{} {} {} {}\n", p.x, p.y, p.z, e.reflectivity));
        }
}

using FireAll = std::function<void(const Writer&)>;

Status write_text(const std::string& path, const std::string& extension, const FireAll& fire_all) {
    std::ofstream out(path);
    if (!out) return cannot_open_to_write(path);
    if (extension == ".csv") {
        out << kShotHeader;
        std::array<char, RowLog::kMaxLine> row;
        fire_all([&](std::int64_t packet, const LidarUnit& unit) {
            for (std::size_t i = 0; i < unit.shots().size(); ++i)
                out << std::string_view(row.data(), format_shot_row(row, unit, packet, i));
        });
    } else {
        constexpr std::array<std::string_view, 4> kFields{"x", "y", "z", "intensity"};
        std::vector<std::string> lines;
        fire_all([&](std::int64_t, const LidarUnit& unit) { add_points(unit, lines); });
        write_cloud(out, extension == ".ply", "LiDAR frame, metres", kFields, lines);
    }
    out.close();
    if (!out) return Error{"cannot be written to the end", path, 0, 0, ErrorKind::failed};
    return Ok{};
}

Status write_capture(const std::string& path, const LidarUnit& of, std::int64_t epoch_unix_ns,
                     const FireAll& fire_all) {
    auto sink = open_packet_sink(path, of.spec().network, true, of.lidar().model->metadata());
    if (!sink) return sink.error();
    fire_all([&](std::int64_t packet, LidarUnit& unit) {
        const std::int64_t unix_ns = epoch_unix_ns + unit.t_sent_ns(packet);
        if (!unit.bytes().empty()) (*sink)->send(PacketKind::data, unit.bytes(), unix_ns);
        if (const auto position = unit.position(packet); !position.empty())
            (*sink)->send(PacketKind::position, position, unix_ns);
    });
    (*sink)->flush();
    if ((*sink)->counters().dropped > 0)
        return Error{"packets could not be written", (*sink)->description(), 0, 0, ErrorKind::failed};
    return Ok{};
}

/// A capture has the LiDAR's metadata beside it, where it has some.
std::vector<std::string> outputs_of(const ScanOptions& o, const Lidar& lidar) {
    if (!o.out.ends_with(".pcap") || lidar.model->metadata().empty()) return {o.out};
    return {o.out, document_beside(o.out)};
}

Outcome scan(const ScanOptions& o) {
    const std::string extension = std::filesystem::path(o.out).extension();
    if (extension != ".csv" && extension != ".ply" && extension != ".pcd" && extension != ".pcap")
        return Error{"unknown kind of file, expected .ply, .pcd, .csv or .pcap", o.out};
    auto scene = o.scene.load();
    if (!scene) return scene.error();
    auto index = sensor_named(scene->lidars, o.lidar, "LiDAR", scene->file);
    if (!index) return index.error();
    if (auto kept = keep_inputs(outputs_of(o, scene->lidars[*index]), *scene, {o.pose.trajectory}); !kept)
        return kept.error();
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    auto world = World::create_for_lidars(*std::move(scene));
    if (!world) return world.error();

    const double duration_s =
        o.duration_s > 0 ? o.duration_s : 1 / (*world)->scene().lidars[*index].model->spec().rate_hz;
    const std::int64_t from_ns = std::llround(o.time_s * 1e9), to_ns = from_ns + std::llround(duration_s * 1e9);
    if (extension == ".pcap" && (*world)->scene().epoch_unix_ns / kSecond_ns + to_ns / kSecond_ns > UINT32_MAX)
        return Error{"the scan ends after 2105, and a capture has 32 bits for the seconds since 1970", o.out};
    if (auto loaded = o.pose.load(**world, from_ns, to_ns); !loaded) return loaded.error();
    if (auto made = make_folder_of(o.out); !made) return made.error();
    LidarUnit unit(**world, *index, extension == ".csv");

    std::size_t packets = 0, shots = 0, returns = 0;
    Progress progress("scanning to " + o.out);
    const auto fire_all = [&](const Writer& write) {
        for (std::int64_t p = unit.first_packet_from(from_ns); unit.packet_start_ns(p) < to_ns; ++p) {
            unit.fire(p);
            ++packets;
            shots += unit.shots().size();
            returns += unit.returns();
            write(p, unit);
            progress.show(
                static_cast<double>(unit.packet_start_ns(p) - from_ns) / static_cast<double>(to_ns - from_ns),
                fmt::format("{} packets", packets));
        }
    };
    const std::int64_t epoch_unix_ns = (*world)->scene().epoch_unix_ns;
    const Status written = extension == ".pcap" ? write_capture(o.out, unit, epoch_unix_ns, fire_all)
                                                : write_text(o.out, extension, fire_all);
    if (!written) return written.error();
    say(fmt::format("wrote {}: {} packets, {} shots, {} returns", o.out, packets, shots, returns));
    return nlohmann::json{{"file", o.out},
                          {"lidar", unit.lidar().name},
                          {"packets", packets},
                          {"shots", shots},
                          {"returns", returns}};
}

}  // namespace

Command add_scan(Parser app) {
    auto o = std::make_shared<ScanOptions>();
    const Parser c =
        app.subcommand("scan", "Scan with a LiDAR: returns (the echoes of shots), all shots, or packets");
    o->scene.add_to(c);
    c.option("--lidar", o->lidar, "Name of the LiDAR (default: the first)").type_name("NAME");
    c.option("--time", o->time_s, "Simulation time of the first packet")
        .type_name("SECONDS")
        .range(0.0, 9e9)
        .shows_default();
    c.option("--duration", o->duration_s, "How long (default: one turn)").type_name("SECONDS").above_zero(3600.0);
    o->pose.add_to(c);
    c.option("-o,--output", o->out,
             "FILE.ply or .pcd (the returns as points), .csv (a row for each shot: the truth, and what is reported "
             "of it before rounding), .pcap "
             "(packets)")
        .type_name("FILE")
        .required();
    c.group("Sensors");
    c.examples({"narpa scan docking -o out/sweep.pcap",
                "narpa scan docking --trajectory docking/approach.csv --time 30 -o out/cloud.ply"});
    return [o] { return scan(*o); };
}

}  // namespace narpa::cli
