/// rehearsal/navigation/node.h - the navigation on its wires: frames and packets in, CAN both ways.
///
/// In lockstep each cycle waits for the emulator's clock and for every frame and packet that falls due; nothing
/// depends on wall time. In real time the cycle runs on the emulator's clock whatever the measurements do, which
/// have a thread of their own and take the newest frame and turn there is.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "base/stop.h"
#include "rehearsal/navigation/navigation_log.h"
#include "rehearsal/navigation/sensor_inputs.h"

namespace narpa::rehearsal {

struct NodeOptions {
    std::string bus;
    SourceList video, lidar;
    bool lockstep = false;
    std::uint64_t seed = 1;
    double wait_s = 30;  ///< for the bus to be there
    std::string log;     ///< folder; empty: none
    std::string version;
};

/// Until the dynamics say that they have finished, or it is stopped. `ready` is called once everything is open.
/// Errors: scenario, scene, sources, bus; a bus that falls silent (failed).
Status navigate(const Scenario& scenario, const NodeOptions& options, const StopFlag& stop,
                const std::function<void()>& ready);

}  // namespace narpa::rehearsal
