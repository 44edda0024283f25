#include "rehearsal/navigation/sensor_receiver.h"

#include <cmath>
#include <utility>

#include "drivers/can/descriptor.h"
#include "protocols/video/embedded_line.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kWait_ns = 50'000'000;
constexpr std::size_t kFramesKept = 4, kNoticesKept = 16;

}  // namespace

SensorReceiver::SensorReceiver(SensorInputs& inputs, const SceneModel& model)
    : inputs_(inputs), model_(model), cameras_(inputs.cameras.size()) {
    for (std::size_t i = 0; i < inputs.cameras.size(); ++i) threads_.emplace_back([this, i] { read_frames(i); });
    for (std::size_t i = 0; i < inputs.lidars.size(); ++i) threads_.emplace_back([this, i] { read_packets(i); });
}

SensorReceiver::~SensorReceiver() {
    stop_ = true;
    for (std::thread& t : threads_) t.join();
}

void SensorReceiver::read_frames(std::size_t i) {
    CameraInput& input = inputs_.cameras[i];
    std::vector<std::uint8_t> bytes(input.frame_bytes);
    while (!stop_ && input.source->status()) {
        if (!input.source->receive(bytes, kWait_ns)) continue;
        const std::int64_t now_ns = monotonic_ns();
        const std::lock_guard lock(mutex_);
        ++frames_;
        auto& arrived = cameras_[i].arrived;
        if (arrived.size() == kFramesKept) arrived.pop_front();
        arrived.push_back({now_ns, bytes});
    }
}

void SensorReceiver::read_packets(std::size_t i) {
    LidarInput& input = inputs_.lidars[i];
    std::vector<std::uint8_t> packet(kDatagramBytesMax);
    while (!stop_) {
        const std::size_t n = input.source->receive(packet, kWait_ns);
        if (n == 0) continue;
        const std::lock_guard lock(mutex_);
        input.buffer.take({packet.data(), n}, monotonic_ns() + offset_ns_);
    }
}

void SensorReceiver::update(const std::vector<FrameNotice>& notices, std::int64_t offset_ns) {
    const std::lock_guard lock(mutex_);
    offset_ns_ = offset_ns;
    for (const FrameNotice& notice : notices)
        for (std::size_t i = 0; i < cameras_.size(); ++i) {
            if (inputs_.cameras[i].camera != notice.camera || notice.delivery == Delivery::nothing) continue;
            auto& kept = cameras_[i].notices;
            if (kept.size() == kNoticesKept) kept.pop_front();
            kept.push_back(notice);
        }
}

std::optional<std::int64_t> SensorReceiver::exposed_ns(const CameraState& state, const Camera& camera,
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

std::optional<SensorReceiver::Frame> SensorReceiver::newest_frame(std::size_t i, std::int64_t t_ns) {
    const std::lock_guard lock(mutex_);
    CameraState& state = cameras_[i];
    const Camera& camera = model_.scene().cameras[inputs_.cameras[i].camera];
    for (auto frame = state.arrived.rbegin(); frame != state.arrived.rend(); ++frame) {
        const auto t_mid_ns = exposed_ns(state, camera, *frame);
        if (!t_mid_ns || *t_mid_ns > t_ns) continue;
        if (*t_mid_ns <= state.taken_ns) return std::nullopt;
        state.taken_ns = *t_mid_ns;
        return Frame{*t_mid_ns, frame->bytes};
    }
    return std::nullopt;
}

bool SensorReceiver::turn(std::size_t i, std::int64_t t_ns, std::vector<RangePoint>& out) {
    const std::lock_guard lock(mutex_);
    const SweepBuffer& buffer = inputs_.lidars[i].buffer;
    buffer.turn(t_ns, out);
    return buffer.complete_to(t_ns);
}

std::uint64_t SensorReceiver::frames() const {
    const std::lock_guard lock(mutex_);
    return frames_;
}

}  // namespace narpa::rehearsal
