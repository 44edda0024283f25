// narpa-navigation - navigation and control of the chaser: frames, LiDAR packets and attitude in, estimates and
// thruster commands out on CAN.
#include <tbb/global_control.h>

#include <optional>

#include "apps/programs/program.h"
#include "drivers/can/can_bus.h"
#include "drivers/video/video_source.h"
#include "rehearsal/navigation/node.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::rehearsal {
namespace {

struct Arguments {
    std::string scenario;
    std::vector<std::string> overrides, video, lidar;
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
    auto video = pairs(a.video, "--video", "CAMERA=SOURCE, like nav=/dev/video10");
    if (!video) return video.error();
    auto lidar = pairs(a.lidar, "--lidar", "LIDAR=SOURCE, like top=udp:2368");
    if (!lidar) return lidar.error();
    a.node.video = *std::move(video), a.node.lidar = *std::move(lidar);
    const auto file = find_file(FileKind::scenario, a.scenario);
    if (!file) return file.error();
    const auto scenario = read_scenario(*file, a.overrides);
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

void add_options(Arguments& a, const cli::Parser& p) {
    p.option("SCENARIO", a.scenario, "Scenario file (TOML), or a name that `narpa list` shows").required();
    p.option("--set", a.overrides, "Value of a key of the scenario or its scene, as `narpa rehearse` takes it")
        .type_name("KEY=VALUE")
        .repeatable();
    p.option("--can", a.node.bus, can_bus_help()).type_name("BUS").joined_by('+').required();
    p.option("--video", a.video, video_source_help() + ", for each of the scenario's cameras")
        .type_name("CAMERA=SOURCE")
        .repeatable();
    p.option("--lidar", a.lidar, "udp:PORT, for each of the scenario's LiDARs")
        .type_name("LIDAR=SOURCE")
        .repeatable();
    p.flag("--lockstep", a.node.lockstep, "Wait for the emulator's clock; nothing depends on wall time");
    p.option("--seed", a.node.seed, "Of the samples of its renders").shows_default();
    p.option("--threads", a.threads, "Threads that render (default: all cores)").range(0, 1024);
    p.option("--wait", a.node.wait_s, "How long to wait for the bus")
        .type_name("SECONDS")
        .range(0.0, 3600.0)
        .shows_default();
    p.option("--log", a.node.log, "Folder for navigation.csv, measurements.csv, navigation.json and pictures")
        .type_name("DIR");
    p.examples(
        {"narpa-navigation docking-camera --can slcan:29537 --video "
         "nav=out/nav --lockstep"});
}

}  // namespace
}  // namespace narpa::rehearsal

int main(int argc, char** argv) {
    using namespace narpa::rehearsal;
    Arguments a;
    a.node.version = NARPA_VERSION;
    return narpa::cli::run_program(
        argc, argv,
        {"narpa-navigation",
         "narpa-navigation is the chaser's flight computer in a rehearsal: it estimates the target's pose from "
         "frames and sweeps and controls the chaser along the scenario's legs.",
         NARPA_VERSION},
        a.ready_fd, [&](const narpa::cli::Parser& p) { add_options(a, p); }, [&] { return run(a); });
}
