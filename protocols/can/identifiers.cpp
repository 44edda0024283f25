#include "protocols/can/identifiers.h"

#include <array>
#include <cstdio>

namespace narpa {

Status check_body_base_id(std::int64_t can_id) {
    if (can_id >= 0 && can_id <= kMaxBodyBaseId && can_id % kBaseIdStep == 0) return Ok{};
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(),
                  "can_id %s0x%llX cannot be a body's: expected a multiple of 16 from 0x000 to 0x%03X",
                  can_id < 0 ? "-" : "", static_cast<unsigned long long>(can_id < 0 ? -can_id : can_id),
                  kMaxBodyBaseId);
    return Error{.what = text.data()};
}

std::string message_name(std::uint32_t id, std::span<const CanBody> bodies) {
    if (id == kHeartbeatId) return "heartbeat";
    const std::uint32_t base = id - id % kBaseIdStep;
    std::string name;
    if (const auto camera = ledger_camera(id)) name = "ledger of camera " + std::to_string(*camera);
    if (base == kEstimateBaseId) name = "emulator's estimate";
    if (base == kActuatorBaseId) name = "thruster command";
    if (base == kNavigationBaseId) name = "navigation estimate";
    if (base == kAttitudeBaseId) name = "attitude report";
    if (base == kDynamicsBaseId) name = "dynamics report";
    if (base == kCameraCommandBaseId) name = "camera command";
    if (base == kCameraTriggerBaseId) name = "camera trigger";
    if (base == kCameraReplyBaseId) name = "camera reply";
    if (base == kCameraStateBaseId) name = "camera state";
    if (base == kLidarBeamBaseId) name = "LiDAR beam";
    for (const CanBody& body : bodies)
        if (base == body.base_id) name = "pose of " + body.name;
    return name.empty() ? "frame" : name + ", part " + std::to_string(id % kBaseIdStep);
}

}  // namespace narpa
