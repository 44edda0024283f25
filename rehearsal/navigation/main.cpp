// narpa-navigation - the chaser's navigation and control: frames, LiDAR packets and attitude in, estimates and
// thruster commands out on CAN.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <iostream>

#include "rehearsal/navigation/node.h"

namespace narpa::rehearsal {
namespace {

struct Arguments {
    std::string scenario;
    std::vector<std::string> video, lidar;
    int threads = 0;
    NodeOptions node;
};

Result<SourceList> pairs(const std::vector<std::string>& texts, const char* flag, const char* expected) {
    SourceList out;
    for (const std::string& text : texts) {
        const std::size_t at = text.find('=');
        if (at == std::string::npos || at == 0 || at + 1 == text.size())
            return Error{fmt::format("{} {}: expected {}", flag, text, expected)};
        out.emplace_back(text.substr(0, at), text.substr(at + 1));
    }
    return out;
}

Status run(Arguments& a) {
    auto video = pairs(a.video, "--video", "CAMERA=SOURCE, like nav=/dev/video10");
    if (!video) return video.error();
    auto lidar = pairs(a.lidar, "--lidar", "LIDAR=SOURCE, like top=udp:2368");
    if (!lidar) return lidar.error();
    a.node.video = *std::move(video), a.node.lidar = *std::move(lidar);
    const auto scenario = read_scenario(a.scenario);
    if (!scenario) return scenario.error();
    std::optional<tbb::global_control> limit;
    if (a.threads > 0)
        limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(a.threads));
    stop_on_signals();
    return navigate(*scenario, a.node, stop_flag(), [] {
        fmt::print("ready\n");
        std::fflush(stdout);
    });
}

int main_of(int argc, char** argv) {
    CLI::App app{
        "narpa-navigation is the chaser's computer in a rehearsal: it finds the target in frames and sweeps, and "
        "steers the chaser along the scenario's legs."};
    app.set_version_flag("--version", NARPA_VERSION);
    app.footer(
        "Exit status: 0 good; 1 ran, but something failed; 2 bad input; 3 a device or permission is missing.");
    Arguments a;
    a.node.version = NARPA_VERSION;
    app.add_option("SCENARIO", a.scenario, "Scenario file (TOML)")->required();
    app.add_option("--can", a.node.bus, "BUS: vcan0 | slcan:PORT | udp:239.74.163.2")->required();
    app.add_option("--video", a.video, "CAMERA=SOURCE: a FIFO, FILE.y4m or /dev/videoN, for each of the scenario's")
        ->allow_extra_args(false);
    app.add_option("--lidar", a.lidar, "LIDAR=SOURCE: udp:PORT, for each of the scenario's")
        ->allow_extra_args(false);
    app.add_flag("--lockstep", a.node.lockstep, "Wait for the emulator's clock; nothing depends on wall time");
    app.add_option("--seed", a.node.seed, "Of the samples of its own renders")->capture_default_str();
    app.add_option("--threads", a.threads, "Threads that render (default: as many as there are processors)")
        ->check(CLI::Range(0, 1024));
    app.add_option("--wait", a.node.wait_s, "Seconds to wait for the bus")
        ->check(CLI::Range(0.0, 3600.0))
        ->capture_default_str();
    app.add_option("--log", a.node.log,
                   "Folder for navigation.csv, measurements.csv, navigation.json and pictures");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        const int asked_for_help = app.exit(e, std::cout, std::cerr);
        return asked_for_help == 0 ? 0 : exit_status(ErrorKind::bad_input);
    }
    if (const Status done = run(a); !done) {
        fmt::print(stderr, "narpa-navigation: {}\n", done.error().text());
        return exit_status(done.error().kind);
    }
    return 0;
}

}  // namespace
}  // namespace narpa::rehearsal

int main(int argc, char** argv) {
    try {
        return narpa::rehearsal::main_of(argc, argv);
    } catch (const std::exception& e) {  // out of memory and the like: nothing of ours throws
        fmt::print(stderr, "narpa-navigation: {}\n", e.what());
        return 1;
    }
}
