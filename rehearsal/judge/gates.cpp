#include "rehearsal/judge/gates.h"

#include <fmt/format.h>

#include <cmath>
#include "base/constants.h"

namespace narpa::rehearsal {
namespace {

std::string last_message(const BusRecord& bus, std::int64_t t_ns) {
    return t_ns == BusRecord::kNever ? "never" : fmt::format("at t = {:.3f} s", bus.seconds(t_ns));
}

}  // namespace

double corridor_clearance_m(const Gates::Corridor& corridor, const Vec3& p) {
    if (p.x < 0) return corridor.radius_m - norm(p);
    const double allowed = corridor.radius_m + p.x * std::tan(corridor.half_angle_deg / kDegPerRad);
    return allowed - std::hypot(p.y, p.z);
}

std::string leg_text(const Scenario& scenario, std::size_t leg) {
    if (leg >= scenario.legs.size() || scenario.legs[leg].name.empty()) return fmt::format("leg {}", leg + 1);
    return fmt::format("leg {} \"{}\"", leg + 1, scenario.legs[leg].name);
}

std::string when(const Scenario& scenario, const BusRecord& bus, std::int64_t t_ns) {
    std::string text = fmt::format("at t = {:.2f} s", bus.seconds(t_ns));
    const ActuatorCommand* command = bus.command_before(t_ns);
    if (!command) return text + " before the first thruster command";
    const std::string_view phase = kGuidancePhases[static_cast<std::size_t>(command->phase)];
    return text + fmt::format(" ({}, {})", leg_text(scenario, command->leg), phase);
}

/// In lockstep each program waits for the one before: poses, the emulator's heartbeat of their time, the command.
/// In real time none waits: it is the one that stopped first.
std::string missing_sender(const Scenario& scenario, const BusRecord& bus) {
    const std::int64_t slack = bus.heartbeats.lockstep ? 1'000'000 : 2 * scenario.period_ns();
    const std::int64_t t_report = bus.reports.empty() ? BusRecord::kNever : bus.reports.back().t_ns;
    const std::int64_t t_command = bus.commands.empty() ? BusRecord::kNever : bus.commands.back().t_ns;
    const std::string last =
        fmt::format("last heard: poses {}, heartbeat {}, thruster command {}", last_message(bus, bus.t_pose_ns),
                    last_message(bus, bus.t_heartbeat_ns), last_message(bus, t_command));
    const auto behind = [&](std::int64_t t, std::int64_t other) {
        return other != BusRecord::kNever && (t == BusRecord::kNever || t < other - slack);
    };
    if (bus.heartbeats.received == 0) return "the emulator was never heard; " + last;
    if (bus.t_pose_ns == BusRecord::kNever) return "the dynamics were never heard; " + last;
    if (behind(bus.t_heartbeat_ns, bus.t_pose_ns)) return "the emulator fell silent; " + last;
    if (bus.heartbeats.lockstep ? behind(t_command, t_report) : behind(t_command, bus.t_pose_ns))
        return fmt::format("the navigation {}; {}",
                           t_command == BusRecord::kNever ? "was never heard" : "fell silent", last);
    return "the dynamics fell silent; " + last;
}

}  // namespace narpa::rehearsal
