/// rehearsal/navigation/node.h - the navigation as a program: frames and packets in, CAN in and out.
///
/// In lockstep each control cycle waits for the emulator's clock and for every frame and packet that is due;
/// nothing depends on wall time. In real time the cycle runs on the emulator's clock, and a separate thread
/// measures from the newest frames and sweeps.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "drivers/can/remote_clock.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// NAME=SOURCE, as on the command line.
using SourceList = std::vector<std::pair<std::string, std::string>>;

struct NodeOptions {
    std::string bus;
    SourceList video, lidar;
    bool lockstep = false;
    std::uint64_t seed = 1;
    double wait_s = 30;                      ///< for the bus
    double silence_s = kHeartbeatSilence_s;  ///< real time: longest time between heartbeats
    std::string log;                         ///< folder; empty: none
    std::string version;
};

/// Runs until the dynamics report the end, or until stopped. `ready` is called once all inputs and the bus are
/// open. Errors: of scenario, scene, sources, bus; a bus without messages for too long, an emulator that has
/// stopped or gone (failed).
Status navigate(const Scenario& scenario, const NodeOptions& options, const StopFlag& stop,
                const std::function<void()>& ready);

}  // namespace narpa::rehearsal
