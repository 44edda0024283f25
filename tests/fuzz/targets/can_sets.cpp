// All messages on CAN: their decoders, and the judge of a rehearsal. The input is a candump log. Unless its first
// line is `raw`, checksums are made good, so that changed signals pass them.
#include <cmath>

#include "protocols/can/candump.h"
#include "protocols/can/crc.h"
#include "protocols/can/messages.h"
#include "rehearsal/judge/judge.h"
#include "tests/fuzz/can_frames.h"
#include "tests/fuzz/fuzz.h"
#include "tests/rehearsal/judge_support.h"

namespace narpa {
namespace {

void make_checksums_good(CanFrame& f) {
    const std::array<std::uint8_t, 2> id{static_cast<std::uint8_t>(f.id), static_cast<std::uint8_t>(f.id >> 8)};
    const std::span<std::uint8_t> data(f.data);
    if (f.fd) {
        const std::uint16_t crc = crc16_ccitt_false(data.first(kFdCrcByte), crc16_ccitt_false(id));
        data[kFdCrcByte] = static_cast<std::uint8_t>(crc);
        data[kFdCrcByte + 1] = static_cast<std::uint8_t>(crc >> 8);
    } else {
        data[kClassicCrcByte] = crc8_j1850(data.first(kClassicCrcByte), crc8_j1850(id));
    }
}

class Decoders {
public:
    void accept(const CanFrame& f, std::int64_t t_ns) {
        PoseCommand pose;
        const PoseStatus status = poses_.accept(f, t_ns, pose);
        ++frames_;
        fuzz::require(status != PoseStatus::incomplete_set, "no frame is an incomplete set");
        if (status == PoseStatus::bad_checksum) (void)fuzz::count(false);
        if (status == PoseStatus::complete) {
            (void)fuzz::count(true);
            const Motion& m = pose.motion;
            fuzz::require(std::abs(norm(m.T_world_body.q) - 1) < 1e-12, "an attitude is unit");
            fuzz::require(is_finite(m.T_world_body.t) && is_finite(m.velocity_m_s) && is_finite(m.rate_rad_s),
                          "a pose is finite");
        }
        Heartbeat heartbeat;
        (void)decode(f, t_ns, heartbeat);
        take(ledgers_, f, t_ns), take(estimates_, f, t_ns), take(actuators_, f, t_ns), take(navigation_, f, t_ns);
        take(attitudes_, f, t_ns), take(dynamics_, f, t_ns);
        take(camera_commands_, f, t_ns), take(camera_triggers_, f, t_ns), take(camera_states_, f, t_ns);
    }

    void check_counts() const {
        std::uint64_t counted = 0;
        for (std::size_t s = 0; s < kDecodeStatusCount; ++s)
            if (static_cast<PoseStatus>(s) != PoseStatus::incomplete_set)
                counted += poses_.count(static_cast<PoseStatus>(s));
        fuzz::require(counted == frames_, "every frame is counted once");
    }

private:
    template <class Message>
    static void take(MessageDecoder<Message>& decoder, const CanFrame& f, std::int64_t t_ns) {
        Message message;
        (void)decoder.accept(f, t_ns, message);
    }
    PoseDecoder poses_{0x100};
    std::uint64_t frames_ = 0;
    MessageDecoder<FrameLedger> ledgers_;
    MessageDecoder<EstimateReport> estimates_;
    MessageDecoder<ActuatorCommand> actuators_;
    MessageDecoder<NavigationEstimate> navigation_;
    MessageDecoder<AttitudeReport> attitudes_;
    MessageDecoder<DynamicsReport> dynamics_;
    MessageDecoder<CameraCommand> camera_commands_;
    MessageDecoder<CameraTrigger> camera_triggers_;
    MessageDecoder<CameraState> camera_states_;
};

}  // namespace
}  // namespace narpa

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const rehearsal::Scenario scenario = rehearsal::small_scenario();
    Decoders decoders;
    rehearsal::Judge judge(scenario);
    const std::string_view text = fuzz::text_of(data, size);
    const bool is_raw = text.starts_with("raw");
    fuzz::for_each_line(text, [&](std::string_view line_text) {
        CandumpLine line;
        if (parse_candump(line_text, line) != nullptr) return;
        if (!is_raw) make_checksums_good(line.frame);
        decoders.accept(line.frame, line.t_ns);
        judge.accept(line.frame, line.t_ns);
    });
    decoders.check_counts();
    (void)judge.finish();
    return 0;
}
