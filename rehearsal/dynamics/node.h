/// rehearsal/dynamics/node.h - the dynamics on a bus: poses, attitude and what happens out, actuator commands in.
///
/// In lockstep the time stands still at every control period until the command for it has come; in real time the
/// clock is the emulator's, and a command holds from its arrival on.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "base/result.h"
#include "base/stop.h"
#include "drivers/can/can_bus.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

struct DynamicsOptions {
    std::uint64_t seed = 1;
    bool lockstep = false;
    std::string log_folder;   ///< empty: none
    double wait_s = 15;       ///< real time: for the first heartbeat
    double patience_s = 300;  ///< lockstep: for a command, and at the end for the emulator
};

/// Flies the scenario to its end. What comes back is dynamics.json: what was drawn, how it ended (`stopped` where a
/// signal ended it), and what was counted. Errors: a scenario that cannot be simulated, a pose that does not fit
/// the wire, silence on the bus, a log that cannot be written.
Result<nlohmann::json> run_dynamics(const Scenario& scenario, const DynamicsOptions& options, CanBus& bus,
                                    const StopFlag& stop);

}  // namespace narpa::rehearsal
