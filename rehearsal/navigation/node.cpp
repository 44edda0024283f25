#include "rehearsal/navigation/node.h"

#include "rehearsal/navigation/loop.h"

namespace narpa::rehearsal {

Status navigate(const Scenario& scenario, const NodeOptions& options, const StopFlag& stop,
                const std::function<void()>& ready) {
    auto autopilot = Autopilot::create(scenario, options.seed);
    if (!autopilot) return autopilot.error();
    auto inputs = open_sensor_inputs(scenario, (*autopilot)->model(), options.video, options.lidar);
    if (!inputs) return inputs.error();
    std::unique_ptr<NavigationLog> log;
    if (!options.log.empty()) {
        auto made = NavigationLog::create(options.log, scenario);
        if (!made) return made.error();
        log = *std::move(made);
    }
    auto bus = join_can_bus(options.bus, options.wait_s, stop);
    if (!bus) return bus.error();
    BusLink link(*std::move(bus));
    ready();

    NodeCounts counts;
    const Loop loop{**autopilot, *inputs, link, log.get(), stop, counts, options.silence_s};
    Status flown = options.lockstep ? fly_in_lockstep(loop) : fly_in_real_time(loop);
    counts.bad_messages = link.bad_messages();
    counts.send_drops = link.counters().send_drops;
    for (const LidarInput& input : inputs->lidars) {
        counts.packets += input.buffer.received();
        counts.packets_bad += input.buffer.bad();
    }
    if (log)
        if (auto written = log->finish(counts, (*autopilot)->restarts(), options.version); !written && flown)
            return written.error();
    return flown;
}

}  // namespace narpa::rehearsal
