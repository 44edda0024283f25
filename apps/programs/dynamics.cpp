// narpa-dynamics - simulates the two bodies of a scenario on a CAN bus.
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/programs/program.h"
#include "base/fifo_priority.h"
#include "base/stop.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/remote_clock.h"
#include "rehearsal/dynamics/node.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::rehearsal {
namespace {

constexpr int kDynamicsPriority = 55;  ///< in real time; below the emulator's CAN thread

struct Arguments {
    std::string scenario, bus;
    std::vector<std::string> overrides;
    std::optional<std::uint64_t> seed;
    DynamicsOptions options;
    int ready_fd = -1;
};

Status simulate(Arguments& a) {
    const auto file = find_file(FileKind::scenario, a.scenario);
    if (!file) return file.error();
    auto scenario = read_scenario(*file, a.overrides);
    if (!scenario) return scenario.error();
    a.options.seed = a.seed.value_or(scenario->seed);
    stop_on_signals();
    // Late poses give wrong images. Real-time priority does no harm: a step takes less than a millisecond.
    if (!a.options.lockstep) take_fifo_priority(kDynamicsPriority);
    auto bus = join_can_bus(a.bus, a.options.wait_s, stop_flag());
    if (!bus) return bus.error();
    notify_ready(a.ready_fd);
    const auto flown = run_dynamics(*scenario, a.options, **bus, stop_flag());
    if (!flown) return flown.error();
    cli::print_error("{}\n", to_text(*flown));
    return Ok{};
}

void add_options(Arguments& a, const cli::Parser& p) {
    p.option("SCENARIO", a.scenario, "Scenario file (TOML), or a name that `narpa list` shows").required();
    p.option("--set", a.overrides, "Value of a key of the scenario or its scene, as `narpa rehearse` takes it")
        .type_name("KEY=VALUE")
        .repeatable();
    p.option("--can", a.bus, can_bus_help()).type_name("BUS").joined_by('+').required();
    p.flag("--lockstep", a.options.lockstep,
           "Each control period waits for its actuator command; the same seed gives the same bytes");
    p.option("--seed", a.seed, "Of all random draws (default: the scenario's)");
    p.option("--log", a.options.log_folder, "Folder for truth.csv and dynamics.json").type_name("DIR");
    p.option("--wait", a.options.wait_s, "How long to wait for the bus and for the first heartbeat")
        .type_name("SECONDS")
        .range(0.0, 3600.0)
        .shows_default();
    p.option("--patience", a.options.patience_s,
             "In lockstep: how long to wait for an actuator command, and at the end for the emulator")
        .type_name("SECONDS")
        .range(0.1, 86400.0)
        .shows_default();
    p.examples({"narpa-dynamics docking-camera --can slcan:29537 --lockstep"});
}

}  // namespace
}  // namespace narpa::rehearsal

int main(int argc, char** argv) {
    using namespace narpa::rehearsal;
    Arguments a;
    a.options.version = NARPA_VERSION;
    return narpa::cli::run_program(
        argc, argv,
        {"narpa-dynamics",
         "narpa-dynamics simulates the two bodies of a rehearsal: poses and attitude reports out on CAN, thruster "
         "commands in.",
         NARPA_VERSION},
        a.ready_fd, [&](const narpa::cli::Parser& p) { add_options(a, p); }, [&] { return simulate(a); });
}
