#include "emulator/telemetry.h"

namespace narpa {

void Telemetry::send(std::int64_t t_ns) noexcept {
    if (!can_) return;
    for (const auto& sensor : sensors_) sensor->send_telemetry(*can_, t_ns, faults_);
    for (EstimateReport report; estimator_ && estimator_->reports().pop(report);) can_->send(report, t_ns);
}

void Telemetry::send_heartbeat(std::int64_t t_ns, RunState state) noexcept {
    if (!can_) return;
    std::uint64_t drops = 0;
    for (const auto& sensor : sensors_) drops += sensor->drops();
    Heartbeat heartbeat = std::exchange(faults_, {});
    heartbeat.t_ns = t_ns;
    heartbeat.state = state;
    heartbeat.no_command = !can_->commanded();
    heartbeat.output_dropped = std::exchange(drops_reported_, drops) != drops;
    can_->send(heartbeat, t_ns);
}

}  // namespace narpa
