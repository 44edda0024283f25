// narpa-navigation - navigation and control of the chaser: frames, LiDAR packets and attitude in, estimates and
// thruster commands out on CAN.
#include <tbb/global_control.h>

#include <optional>

#include "rehearsal/navigation/node.h"
#include "rehearsal/program_main.h"

namespace narpa::rehearsal {
namespace {

struct Arguments {
    std::string scenario;
    std::vector<std::string> video, lidar;
    int threads = 0, ready_fd = -1;
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
    if (auto good = check_ready_fd(a.ready_fd); !good) return good;
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
    return navigate(*scenario, a.node, stop_flag(), [&] {
        fmt::print("ready\n");
        std::fflush(stdout);
        notify_ready(a.ready_fd);
    });
}

}  // namespace
}  // namespace narpa::rehearsal

int main(int argc, char** argv) {
    using namespace narpa::rehearsal;
    CLI::App app{
        "narpa-navigation is the chaser's flight computer in a rehearsal: it estimates the target's pose from "
        "frames "
        "and sweeps and controls the chaser along the scenario's legs.",
        "narpa-navigation"};
    Arguments a;
    a.node.version = NARPA_VERSION;
    app.add_option("SCENARIO", a.scenario, "Scenario file (TOML)")->required();
    app.add_option("--can", a.node.bus, "BUS: vcan0 | slcan:PORT | udp:239.74.163.2")->required();
    app.add_option("--video", a.video, "CAMERA=SOURCE: a FIFO, FILE.y4m or /dev/videoN, for each of the scenario's")
        ->allow_extra_args(false);
    app.add_option("--lidar", a.lidar, "LIDAR=SOURCE: udp:PORT, for each of the scenario's")
        ->allow_extra_args(false);
    app.add_flag("--lockstep", a.node.lockstep, "Wait for the emulator's clock; nothing depends on wall time");
    app.add_option("--seed", a.node.seed, "Of the samples of its renders")->capture_default_str();
    app.add_option("--threads", a.threads, "Threads that render (default: as many as there are processors)")
        ->check(CLI::Range(0, 1024));
    app.add_option("--wait", a.node.wait_s, "Seconds to wait for the bus")
        ->check(CLI::Range(0.0, 3600.0))
        ->capture_default_str();
    app.add_option("--log", a.node.log,
                   "Folder for navigation.csv, measurements.csv, navigation.json and pictures");
    add_ready_fd(app, a.ready_fd);
    return run_program(app, argc, argv, [&] { return run(a); });
}
