/// rehearsal/dynamics/node.h - the dynamics as a program on the bus: poses, attitude reports and phases out,
/// thruster commands in.
///
/// In lockstep, time stops at every control period until its command arrives. In real time the clock is the
/// emulator's, and a command takes effect at its time, or at its arrival if that is later.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/result.h"
#include "base/stop.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/remote_clock.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

struct DynamicsOptions {
    std::uint64_t seed = 1;
    bool lockstep = false;
    std::string log_folder;                  ///< empty: none
    double wait_s = 15;                      ///< real time: for the first heartbeat
    double patience_s = 300;                 ///< lockstep: for a command, and at the end for the emulator
    double silence_s = kHeartbeatSilence_s;  ///< real time: longest time between heartbeats
    std::string version;
};

/// Runs the scenario to its end. Returns dynamics.json, which it writes into the log folder: random draws, ending
/// (`stopped` after a signal), counts. Errors: a pose outside the range of its message, no messages for too long,
/// an emulator that has stopped or gone, a log that cannot be written.
Result<nlohmann::json> run_dynamics(const Scenario& scenario, const DynamicsOptions& options, CanBus& bus,
                                    const StopFlag& stop);

/// A one-line summary of that document.
[[nodiscard]] std::string to_text(const nlohmann::json& document);

}  // namespace narpa::rehearsal
