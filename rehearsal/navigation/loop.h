/// rehearsal/navigation/loop.h - what both loops of the node work with.
#pragma once

#include "base/stop.h"
#include "rehearsal/navigation/autopilot.h"
#include "rehearsal/navigation/bus_link.h"
#include "rehearsal/navigation/navigation_log.h"
#include "rehearsal/navigation/sensor_inputs.h"

namespace narpa::rehearsal {

struct Loop {
    Autopilot& autopilot;
    SensorInputs& inputs;
    BusLink& link;
    NavigationLog* log;  ///< null: none
    const StopFlag& stop;
    NodeCounts& counts;

    [[nodiscard]] bool over() const {
        const auto& dynamics = link.dynamics();
        return stop.load(std::memory_order_relaxed) || (dynamics && dynamics->phase == DynamicsPhase::finished);
    }
    /// Sends what a cycle says, and keeps it.
    void say(const CycleRecord& record) const {
        link.send(record.estimate);
        link.send(record.command);
        if (log) log->cycle(record);
        ++counts.cycles;
    }
};

}  // namespace narpa::rehearsal
