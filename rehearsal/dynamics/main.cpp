// narpa-dynamics - flies the two bodies of a scenario on a CAN bus. This file: arguments, exit status.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <optional>

#include "base/stop.h"
#include "drivers/can/remote_clock.h"
#include "rehearsal/dynamics/node.h"

namespace narpa::rehearsal {
namespace {

struct Arguments {
    std::string scenario, bus;
    std::optional<std::uint64_t> seed;
    DynamicsOptions options;
};

int fail(const Error& error) {
    fmt::print(stderr, "narpa-dynamics: {}\n", error.text());
    return exit_status(error.kind);
}

Status write(const nlohmann::json& document, const std::string& path) {
    std::ofstream file(path);
    file << document.dump(2) << '\n';
    file.close();
    if (!file) return Error{"cannot be written", path, 0, 0, ErrorKind::failed};
    return Ok{};
}

int fly(Arguments a) {
    auto scenario = read_scenario(a.scenario);
    if (!scenario) return fail(scenario.error());
    a.options.seed = a.seed.value_or(scenario->seed);

    stop_on_signals();
    auto bus = join_can_bus(a.bus, a.options.wait_s, stop_flag());
    if (!bus) return fail(bus.error());
    auto flown = run_dynamics(*scenario, a.options, **bus, stop_flag());
    if (!flown) return fail(flown.error());
    nlohmann::json& document = *flown;
    document["version"] = NARPA_VERSION;
    if (!a.options.log_folder.empty())
        if (auto written = write(document, a.options.log_folder + "/dynamics.json"); !written)
            return fail(written.error());

    const nlohmann::json& commands = document["actuator_commands"];
    fmt::print(
        stderr,
        "{}: seed {}, {:.3f} s, {}; {} actuator commands applied, {} lost, {} late, {} refused, {} bad frames; "
        "{} CAN frames dropped\n",
        scenario->name, a.options.seed, document["end_s"].get<double>(),
        document["stopped"].get<bool>() ? "stopped" : document["ending"].get<std::string>(),
        commands["applied"].get<std::uint64_t>(), commands["lost"].get<std::uint64_t>(),
        commands["late"].get<std::uint64_t>(), commands["refused"].get<std::uint64_t>(),
        commands["bad_frames"].get<std::uint64_t>(), document["bus"]["frames_dropped"].get<std::uint64_t>());
    return 0;
}

/// CLI::Range lets NaN through.
CLI::Validator seconds_within(double least, double most) {
    return {[=](std::string& text) {
                const double value = std::strtod(text.c_str(), nullptr);
                return value >= least && value <= most
                           ? ""
                           : fmt::format("{}: expected seconds from {} to {}", text, least, most);
            },
            "SECONDS"};
}

int run(int argc, char** argv) {
    CLI::App app{
        "narpa-dynamics flies the two bodies of a rehearsal: poses and what the chaser's attitude sensors "
        "measure out on CAN, actuator commands in."};
    app.set_version_flag("--version", NARPA_VERSION);
    app.footer(
        "Exit status: 0 good; 1 ran, but something failed; 2 bad input; 3 a device or permission is missing.");
    Arguments a;
    app.add_option("SCENARIO", a.scenario, "What is flown (TOML)")->required();
    app.add_option("--can", a.bus, "BUS: vcan0 | slcan:PORT | udp:239.74.163.2")->required();
    app.add_flag(
        "--lockstep", a.options.lockstep,
        "Time stands still until the actuator command for it has come; the same seed gives the same bytes");
    app.add_option("--seed", a.seed, "Of all that is drawn at random (default: the scenario's)")
        ->check(CLI::NonNegativeNumber);
    app.add_option("--log", a.options.log_folder, "Folder for truth.csv and dynamics.json");
    app.add_option("--wait", a.options.wait_s, "Seconds to wait for the bus and for the first heartbeat")
        ->check(seconds_within(0, 3600))
        ->capture_default_str();
    app.add_option("--patience", a.options.patience_s,
                   "In lockstep: seconds to wait for an actuator command, and at the end for the emulator")
        ->check(seconds_within(0.1, 86400))
        ->capture_default_str();
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        const int asked_for_help = app.exit(e, std::cout, std::cerr);
        return asked_for_help == 0 ? 0 : exit_status(ErrorKind::bad_input);
    }
    return fly(std::move(a));
}

}  // namespace
}  // namespace narpa::rehearsal

int main(int argc, char** argv) {
    try {
        return narpa::rehearsal::run(argc, argv);
    } catch (const std::exception& e) {  // out of memory and the like: nothing of ours throws
        fmt::print(stderr, "narpa-dynamics: {}\n", e.what());
        return 1;
    }
}
