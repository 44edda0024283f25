#include "protocols/can/messages.h"

#include <array>
#include <cstdio>

namespace narpa {
namespace {

constexpr std::array kMessages{
    &kPoseLayout,          &kLedgerLayout,      &kEstimateLayout,    &kHeartbeatLayout, &kCameraCommandLayout,
    &kCameraTriggerLayout, &kCameraReplyLayout, &kCameraStateLayout, &kLidarBeamLayout, &kClockLayout,
    &kActuatorLayout,      &kNavigationLayout,  &kAttitudeLayout,    &kDynamicsLayout,
};

/// Frames of this identifier belong to the message; of those per camera, to any of them.
constexpr bool owns(const SetLayout& m, std::uint32_t id) noexcept {
    if (m.instances == Instances::per_camera) return ledger_camera(id).has_value();
    if (m.instances == Instances::per_body) return id <= kMaxBodyBaseId + kFdOffset;
    const std::uint32_t index = id - m.base_id;
    return index < m.frames.size() || (m.fd_counter_bit != 0 && index == kFdOffset);
}

/// Identifiers of the table's messages do not collide. In four parts, as compilers limit the steps of an
/// evaluation.
constexpr bool is_unique(std::uint32_t from) {
    for (std::uint32_t id = from; id < from + 0x200; ++id)
        if (std::ranges::count_if(kMessages, [id](const SetLayout* m) { return owns(*m, id); }) > 1) return false;
    return true;
}
static_assert(is_unique(0));
static_assert(is_unique(0x200));
static_assert(is_unique(0x400));
static_assert(is_unique(0x600));

/// Signals lie within their frames.
constexpr bool is_consistent() {
    for (const SetLayout* m : kMessages)
        for (const Signal& s : m->signals)
            if (s.classic.frame >= m->frames.size() ||
                s.classic.start_bit + s.classic.length > kClassicPayloadBits || m->signals.size() > kMaxSignals ||
                m->fd_counter_bit + 8 > 8 * kFdCrcByte)
                return false;
    return true;
}
static_assert(is_consistent());

}  // namespace

std::span<const SetLayout* const> can_messages() noexcept {
    return kMessages;
}

std::string message_name(std::uint32_t id, std::span<const CanBody> bodies) {
    const std::string part = ", part " + std::to_string(id % kBaseIdStep);
    for (const CanBody& body : bodies)
        if (id - id % kBaseIdStep == body.base_id)
            return std::string(kPoseLayout.title) + " of " + body.name + part;
    for (const SetLayout* m : kMessages) {
        if (m->instances == Instances::per_body || !owns(*m, id)) continue;
        std::string title(m->title);
        if (m->fd_counter_bit == 0) return title;
        return title + (m->instances == Instances::one ? "" : " of camera " + std::to_string(*ledger_camera(id))) +
               part;
    }
    return "frame";
}

bool is_closed_loop(std::uint32_t id) noexcept {
    return std::ranges::any_of(kMessages, [id](const SetLayout* m) {
        return m->route.sender != "narpa" && m->route.receiver != "narpa" && owns(*m, id);
    });
}

std::string EncodeStatus::text() const {
    std::array<char, 160> text{};
    const char* space = unit.empty() ? "" : " ";
    std::snprintf(text.data(), text.size(), "%.*s = %.9g%s%.*s is outside %.9g .. %.9g%s%.*s",
                  static_cast<int>(quantity.size()), quantity.data(), value, space, static_cast<int>(unit.size()),
                  unit.data(), min, max, space, static_cast<int>(unit.size()), unit.data());
    return text.data();
}

// --- Pose command: one that does not fit is refused
// ---------------------------------------------------------------

namespace {

EncodeStatus quantise(const PoseCommand& command, BitField Signal::*form, RawSignals& raw) noexcept {
    const double length = norm(command.motion.T_world_body.q);
    if (!(std::abs(length - 1.0) <= kUnitTolerance))
        return {"AttitudeNorm", "", length, 1.0 - kUnitTolerance, 1.0 + kUnitTolerance};
    EncodeStatus status;
    raw = raw_signals(command, form, &status);
    return status;
}

}  // namespace

EncodeStatus encode_classic(const PoseCommand& command, std::uint32_t base_id, FrameSet& out) noexcept {
    RawSignals raw{};
    const EncodeStatus status = quantise(command, &Signal::classic, raw);
    if (status) out = encode_classic(kPoseLayout, raw, command.counter, base_id);
    return status;
}

EncodeStatus encode_fd(const PoseCommand& command, std::uint32_t base_id, CanFrame& out) noexcept {
    RawSignals raw{};
    const EncodeStatus status = quantise(command, &Signal::fd, raw);
    if (status) out = encode_fd(kPoseLayout, raw, command.counter, base_id);
    return status;
}

EncodeStatus encode(const PoseCommand& command, std::uint32_t base_id, bool fd, FrameSet& out) noexcept {
    if (!fd) return encode_classic(command, base_id, out);
    CanFrame frame;
    const EncodeStatus status = encode_fd(command, base_id, frame);
    if (status) out = FrameSet(frame);
    return status;
}

}  // namespace narpa
