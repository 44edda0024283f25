/// rehearsal/navigation/loop.h - shared parts of the lockstep and the real-time loop.
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
    double silence_s;  ///< real time: longest time between heartbeats

    [[nodiscard]] bool over() const {
        const auto& dynamics = link.dynamics();
        return stop.load(std::memory_order_relaxed) || (dynamics && dynamics->phase == DynamicsPhase::finished);
    }
    [[nodiscard]] Error failed(std::string what) const {
        return {std::move(what), link.description(), 0, 0, ErrorKind::failed};
    }
    /// `i`: index in the scenario's list.
    void take_frame(std::size_t i, std::int64_t t_mid_ns, std::span<const std::uint8_t> bytes) const {
        if (log) log->frame(autopilot.model().scene().cameras[inputs.cameras[i].camera], bytes);
        autopilot.take_frame(i, t_mid_ns, bytes);
    }
    /// Takes the shots that were received over CAN and fired by t_ns.
    void take_beams(std::int64_t t_ns) const {
        for (const LidarBeamReport& beam : link.take_beams(t_ns)) autopilot.take_beam(beam);
    }
    /// Sends and logs the results of a cycle.
    void publish(const CycleRecord& record) const {
        link.send(record.estimate);
        link.send(record.command);
        if (log) log->cycle(record);
        ++counts.cycles;
    }
};

/// Uses simulation time only. Errors: no messages on the bus for too long, an emulator that has stopped, a lost
/// connection to the bus, a video source that has failed.
Status fly_in_lockstep(const Loop& loop);

/// Uses the emulator's clock. The calling thread receives from the bus and runs a cycle each period. Each source
/// has a reader thread. One more thread measures: when the chaser's attitude at t_k has arrived, it uses the newest
/// frame of each camera and the newest sweep of each LiDAR that end by t_k. Errors: no heartbeat, at the start or
/// for too long, an emulator that has stopped.
Status fly_in_real_time(const Loop& loop);

}  // namespace narpa::rehearsal
