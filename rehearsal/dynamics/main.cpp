// narpa-dynamics - simulates the two bodies of a scenario on a CAN bus.
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/stop.h"
#include "drivers/can/remote_clock.h"
#include "rehearsal/dynamics/node.h"
#include "rehearsal/program_main.h"

namespace narpa::rehearsal {
namespace {

struct Arguments {
    std::string scenario, bus;
    std::optional<std::uint64_t> seed;
    DynamicsOptions options;
    int ready_fd = -1;
};

Status simulate(Arguments& a) {
    if (auto good = check_ready_fd(a.ready_fd); !good) return good;
    auto scenario = read_scenario(a.scenario);
    if (!scenario) return scenario.error();
    a.options.seed = a.seed.value_or(scenario->seed);
    stop_on_signals();
    auto bus = join_can_bus(a.bus, a.options.wait_s, stop_flag());
    if (!bus) return bus.error();
    notify_ready(a.ready_fd);
    const auto flown = run_dynamics(*scenario, a.options, **bus, stop_flag());
    if (!flown) return flown.error();
    fmt::print(stderr, "{}\n", in_words(*flown));
    return Ok{};
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

}  // namespace
}  // namespace narpa::rehearsal

int main(int argc, char** argv) {
    using namespace narpa::rehearsal;
    CLI::App app{
        "narpa-dynamics simulates the two bodies of a rehearsal: poses and attitude reports out on CAN, thruster "
        "commands in.",
        "narpa-dynamics"};
    Arguments a;
    a.options.version = NARPA_VERSION;
    app.add_option("SCENARIO", a.scenario, "Scenario file (TOML)")->required();
    app.add_option("--can", a.bus, "BUS: vcan0 | slcan:PORT | udp:239.74.163.2")->required();
    app.add_flag("--lockstep", a.options.lockstep,
                 "Each control period waits for its actuator command; the same seed gives the same bytes");
    app.add_option("--seed", a.seed, "Of all random draws (default: the scenario's)")
        ->check(CLI::NonNegativeNumber);
    app.add_option("--log", a.options.log_folder, "Folder for truth.csv and dynamics.json");
    app.add_option("--wait", a.options.wait_s, "Seconds to wait for the bus and for the first heartbeat")
        ->check(seconds_within(0, 3600))
        ->capture_default_str();
    app.add_option("--patience", a.options.patience_s,
                   "In lockstep: seconds to wait for an actuator command, and at the end for the emulator")
        ->check(seconds_within(0.1, 86400))
        ->capture_default_str();
    add_ready_fd(app, a.ready_fd);
    return run_program(app, argc, argv, [&] { return simulate(a); });
}
