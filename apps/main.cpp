// narpa - hardware-in-the-loop camera and LiDAR emulator. This file: its subcommands; `narpa bench` starts
// narpa-bench.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <vector>

#include "apps/cli.h"
#include "base/program_beside.h"

namespace narpa::cli {
namespace {

/// For --help: start_bench has taken its command lines.
Command add_bench(Parser app) {
    app.subcommand("bench", "Measure speed against error").group("Measure");
    return {};
}

/// Replaces this program by narpa-bench; returns the exit status only where that fails. `bench`: that word in argv.
int start_bench(char** argv, char** bench) {
    const bool json = std::any_of(argv, bench, [](std::string_view word) { return word == "--json"; });
    const std::string program = program_beside("narpa-bench");
    std::copy_backward(argv + 1, bench, bench + 1);
    argv[1] = argv[0];
    ::execvp(program.c_str(), argv + 1);
    if (errno == ENOENT)
        return finish(Error{"is not built or not installed", program, 0, 0, ErrorKind::missing,
                            "apt install narpa-dev, or cmake --build --preset release --target narpa-bench"},
                      json);
    return finish(Error{std::strerror(errno), program, 0, 0, ErrorKind::missing}, json);
}

}  // namespace
}  // namespace narpa::cli

int main(int argc, char** argv) {
    using namespace narpa::cli;
    char** const first =
        std::find_if(argv + 1, argv + argc, [](std::string_view word) { return word != "--json"; });
    if (first < argv + argc && *first == std::string_view("bench")) return start_bench(argv, first);
    return run_commands(
        argc, argv,
        {"narpa",
         "narpa emulates a spacecraft's camera and LiDAR: poses in on CAN, camera frames out on V4L2, "
         "LiDAR packets out on UDP.",
         {"narpa rehearse docking                        a docking in a closed loop, with a report",
          "narpa render docking -o out/view.png          what the camera sees",
          "narpa run docking --can vcan0 --video nav=/dev/video10 --log out/run"}},
        {add_list, add_check, add_rehearse, add_run, add_fly, add_render, add_map, add_scan, add_dataset, add_judge,
         add_estimate, add_calibrate, add_compare, add_replay, add_bench});
}
