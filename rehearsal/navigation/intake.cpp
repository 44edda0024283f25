#include "rehearsal/navigation/intake.h"

#include <array>
#include <cmath>
#include <utility>

#include "drivers/can/descriptor.h"
#include "protocols/video/embedded_line.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kWait_ns = 50'000'000;
constexpr std::size_t kFramesKept = 4, kNoticesKept = 16;

}  // namespace

Intake::Intake(SensorWires& wires, const SightModel& model)
    : wires_(wires), model_(model), cameras_(wires.cameras.size()) {
    for (std::size_t i = 0; i < wires.cameras.size(); ++i) threads_.emplace_back([this, i] { read_frames(i); });
    for (std::size_t i = 0; i < wires.lidars.size(); ++i) threads_.emplace_back([this, i] { read_packets(i); });
}

Intake::~Intake() {
    stop_ = true;
    for (std::thread& t : threads_) t.join();
}

void Intake::read_frames(std::size_t i) {
    CameraWire& wire = wires_.cameras[i];
    std::vector<std::uint8_t> bytes(wire.frame_bytes);
    while (!stop_ && wire.source->status()) {
        if (!wire.source->receive(bytes, kWait_ns)) continue;
        const std::int64_t now_ns = monotonic_ns();
        const std::lock_guard lock(mutex_);
        ++frames_;
        auto& arrived = cameras_[i].arrived;
        if (arrived.size() == kFramesKept) arrived.pop_front();
        arrived.push_back({now_ns, bytes});
    }
}

void Intake::read_packets(std::size_t i) {
    LidarWire& wire = wires_.lidars[i];
    std::array<std::uint8_t, 2048> packet;
    while (!stop_) {
        const std::size_t n = wire.source->receive(packet, kWait_ns);
        if (n == 0) continue;
        const std::lock_guard lock(mutex_);
        wire.buffer.take({packet.data(), n}, monotonic_ns() + offset_ns_);
    }
}

void Intake::hear(const std::vector<FrameNotice>& notices, std::int64_t offset_ns) {
    const std::lock_guard lock(mutex_);
    offset_ns_ = offset_ns;
    for (const FrameNotice& notice : notices)
        for (std::size_t i = 0; i < cameras_.size(); ++i) {
            if (wires_.cameras[i].camera != notice.camera || notice.delivery == Delivery::nothing) continue;
            auto& kept = cameras_[i].notices;
            if (kept.size() == kNoticesKept) kept.pop_front();
            kept.push_back(notice);
        }
}

std::optional<std::int64_t> Intake::exposed_ns(const CameraState& state, const Camera& camera,
                                               const Arrived& frame) const {
    if (camera.embedded_line) {
        const std::size_t row = frame.bytes.size() / static_cast<std::size_t>(camera.height);
        const auto ledger = decode_embedded_line(std::span(frame.bytes).last(row));
        return ledger ? std::optional(ledger->t_exposure_mid_ns) : std::nullopt;
    }
    const FrameNotice* nearest = nullptr;
    std::int64_t least_ns = camera.period_ns / 2;
    for (const FrameNotice& notice : state.notices) {
        const std::int64_t off_ns = std::abs(frame.t_arrived_ns + offset_ns_ - notice.t_hand_over_ns);
        if (off_ns < least_ns) nearest = &notice, least_ns = off_ns;
    }
    if (!nearest || nearest->delivery != Delivery::frame) return std::nullopt;
    return nearest->t_mid_ns;
}

std::optional<Intake::Frame> Intake::newest_frame(std::size_t i, std::int64_t t_ns) {
    const std::lock_guard lock(mutex_);
    CameraState& state = cameras_[i];
    const Camera& camera = model_.scene().cameras[wires_.cameras[i].camera];
    for (auto frame = state.arrived.rbegin(); frame != state.arrived.rend(); ++frame) {
        const auto t_mid_ns = exposed_ns(state, camera, *frame);
        if (!t_mid_ns || *t_mid_ns > t_ns) continue;
        if (*t_mid_ns <= state.taken_ns) return std::nullopt;
        state.taken_ns = *t_mid_ns;
        return Frame{*t_mid_ns, frame->bytes};
    }
    return std::nullopt;
}

bool Intake::turn(std::size_t i, std::int64_t t_ns, std::vector<RangePoint>& out) {
    const std::lock_guard lock(mutex_);
    const TurnBuffer& buffer = wires_.lidars[i].buffer;
    buffer.turn(t_ns, out);
    return buffer.complete_to(t_ns);
}

std::uint64_t Intake::frames() const {
    const std::lock_guard lock(mutex_);
    return frames_;
}

}  // namespace narpa::rehearsal
