/// emulator/telemetry.h - what a run reports on the CAN bus: ledgers, estimates and a heartbeat with the faults
/// since the last one. One thread uses it; does nothing without a bus.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "emulator/can_node.h"
#include "emulator/online_estimator.h"
#include "emulator/sensor.h"

namespace narpa {

class Telemetry {
public:
    /// `can` and `estimator` may be null. All outlive the telemetry.
    Telemetry(CanNode* can, const std::vector<std::unique_ptr<Sensor>>& sensors, OnlineEstimator* estimator)
        : can_(can), sensors_(sensors), estimator_(estimator) {}

    /// Sends what the sensors and the estimator have gathered.
    void send(std::int64_t t_ns) noexcept;
    void send_heartbeat(std::int64_t t_ns, RunState state) noexcept;

private:
    CanNode* can_;
    const std::vector<std::unique_ptr<Sensor>>& sensors_;
    OnlineEstimator* estimator_;
    Heartbeat faults_{};
    std::uint64_t drops_reported_ = 0;
};

}  // namespace narpa
