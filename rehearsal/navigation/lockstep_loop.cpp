#include <fmt/format.h>

#include <optional>

#include "drivers/descriptor.h"
#include "rehearsal/navigation/loop.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kEmulatorPatience_ns = 600 * kSecond_ns;  // the emulator may render large frames
constexpr std::int64_t kFrameWait_ns = 10 * kSecond_ns, kPacketWait_ns = 1 * kSecond_ns;

class LockstepLoop {
public:
    explicit LockstepLoop(const Loop& loop) : loop_(loop), newest_(loop.inputs.cameras.size()) {}

    Status fly() {
        if (auto began = wait_for([&] { return loop_.link.dynamics() && loop_.link.attitude(); },
                                  "a report of the dynamics");
            !began || loop_.over())
            return began;
        const std::int64_t t_start_ns = loop_.link.dynamics()->t_start_ns;
        if (auto started = loop_.autopilot.start(t_start_ns, *loop_.link.attitude()); !started) return started;
        const std::int64_t period_ns = loop_.autopilot.scenario().period_ns();
        for (std::int64_t t_ns = t_start_ns;; t_ns += period_ns) {
            auto reached = wait_for([&] { return loop_.link.clock().reached(t_ns); },
                                    fmt::format("a heartbeat of {:.3f} s", 1e-9 * static_cast<double>(t_ns)));
            if (!reached || loop_.over()) return reached;
            cycle(t_ns, t_ns == t_start_ns);
        }
    }

private:
    struct Frame {
        std::int64_t t_mid_ns = 0;
        std::vector<std::uint8_t> bytes;
    };

    template <class Condition>
    Status wait_for(const Condition& met, const std::string& what) {
        const std::int64_t deadline = monotonic_ns() + kEmulatorPatience_ns;
        while (!met() && !loop_.over()) {
            loop_.link.receive(kSecond_ns / 50);
            if (auto read = read_frames(); !read) return read;
            read_packets();
            if (met() || loop_.over()) break;
            if (loop_.link.dynamics() && loop_.link.clock().stopping())  // otherwise it is from an earlier run
                return loop_.failed(fmt::format("the emulator has stopped, expected {}", what));
            if (loop_.link.counters().interface_down > 0)
                return loop_.failed(fmt::format("the connection to the emulator was lost, expected {}", what));
            if (monotonic_ns() > deadline)
                return loop_.failed(fmt::format(
                    "nothing in {1} s, expected {0}: are `narpa run --lockstep` and the dynamics there?", what,
                    kEmulatorPatience_ns / kSecond_ns));
        }
        return Ok{};
    }

    /// Reads all announced frames immediately: the emulator blocks until the FIFO has room.
    Status read_frames() {
        for (const FrameNotice& notice : loop_.link.take_notices()) {
            if (notice.delivery == Delivery::nothing) continue;
            for (std::size_t i = 0; i < loop_.inputs.cameras.size(); ++i) {
                CameraInput& input = loop_.inputs.cameras[i];
                if (input.camera != notice.camera) continue;
                buffer_.resize(input.frame_bytes);
                if (!input.source->receive(buffer_, kFrameWait_ns)) {
                    if (!input.source->status()) return input.source->status();
                    ++loop_.counts.frames_missing;
                    continue;
                }
                ++loop_.counts.frames;
                if (notice.delivery == Delivery::frame) newest_[i] = Frame{notice.t_mid_ns, buffer_};
            }
        }
        return Ok{};
    }

    void read_packets() {
        for (LidarInput& input : loop_.inputs.lidars)
            while (const std::size_t n = input.source->receive(packet_, 0)) take_packet(input, n);
    }
    void take_packet(LidarInput& input, std::size_t bytes) {
        input.buffer.take({packet_.data(), bytes}, loop_.link.clock().newest().t_ns);
    }

    void cycle(std::int64_t t_ns, bool first) {
        loop_.autopilot.take(*loop_.link.attitude());
        loop_.autopilot.take(loop_.link.dynamics()->phase, t_ns);
        loop_.take_beams(t_ns);
        for (std::size_t i = 0; i < newest_.size(); ++i) {
            if (!newest_[i]) continue;  // none since the last cycle
            loop_.take_frame(i, newest_[i]->t_mid_ns, newest_[i]->bytes);
            newest_[i].reset();
        }
        if (!first)  // no packet has been completed yet
            for (std::size_t i = 0; i < loop_.inputs.lidars.size(); ++i) measure_sweep(i, t_ns);
        loop_.publish(loop_.autopilot.cycle(t_ns));
    }

    void measure_sweep(std::size_t i, std::int64_t t_ns) {
        LidarInput& input = loop_.inputs.lidars[i];
        const std::int64_t deadline = monotonic_ns() + kPacketWait_ns;
        while (!input.buffer.complete_to(t_ns)) {
            const std::int64_t left_ns = deadline - monotonic_ns();
            const std::size_t n = left_ns > 0 ? input.source->receive(packet_, left_ns) : 0;
            if (n == 0) break;
            take_packet(input, n);
        }
        if (!input.buffer.complete_to(t_ns)) ++loop_.counts.turns_incomplete;
        input.buffer.turn(t_ns, sweep_);
        if (!sweep_.points.empty()) loop_.autopilot.take_sweep(i, t_ns, sweep_);
    }

    const Loop& loop_;
    std::vector<std::optional<Frame>> newest_;
    std::vector<std::uint8_t> buffer_;
    std::vector<std::uint8_t> packet_ = std::vector<std::uint8_t>(kDatagramBytesMax);
    LidarSweep sweep_;
};

}  // namespace

Status fly_in_lockstep(const Loop& loop) {
    return LockstepLoop(loop).fly();
}

}  // namespace narpa::rehearsal
