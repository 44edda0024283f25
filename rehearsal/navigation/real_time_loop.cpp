#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "base/fifo_priority.h"
#include "base/stop.h"
#include "drivers/descriptor.h"
#include "estimator/features/feature_matcher.h"
#include "protocols/video/embedded_line.h"
#include "rehearsal/navigation/loop.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kTimeout_ns = 60 * kSecond_ns;  ///< for the first heartbeat and report
/// Longest delays after t_k: of its attitude report, and of frames and packets that end at t_k.
constexpr std::int64_t kReportWait_ns = 50 * kMs, kSensorWait_ns = 60 * kMs;
/// A command takes effect this long after t_k: by then it has arrived, so the actual thrust is that known to the
/// filter.
constexpr std::int64_t kCommandLead_ns = 60 * kMs;
constexpr int kCyclePriority = 50;  ///< below the emulator's CAN thread

constexpr std::int64_t kReadWait_ns = 50'000'000;
constexpr std::size_t kFramesKept = 4, kNoticesKept = 16;

/// Reads the sources, one thread each, keeps the newest frames and packets, and determines each frame's exposure
/// time.
class SensorReceiver {
public:
    /// Both references outlive it.
    SensorReceiver(SensorInputs& inputs, const SceneModel& model)
        : inputs_(inputs), model_(model), cameras_(inputs.cameras.size()) {
        for (std::size_t i = 0; i < inputs.cameras.size(); ++i)
            threads_.emplace_back([this, i] { read_frames(i); });
        for (std::size_t i = 0; i < inputs.lidars.size(); ++i)
            threads_.emplace_back([this, i] { read_packets(i); });
    }
    ~SensorReceiver() {
        stop_ = true;
        for (std::thread& t : threads_) t.join();
    }
    SensorReceiver(const SensorReceiver&) = delete;
    SensorReceiver& operator=(const SensorReceiver&) = delete;

    /// Frame notices from the bus, and simulation clock minus CLOCK_MONOTONIC.
    void update(const std::vector<FrameNotice>& notices, std::int64_t offset_ns) {
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

    struct Frame {
        std::int64_t t_mid_ns = 0;
        std::vector<std::uint8_t> bytes;
    };
    /// The newest frame exposed at or before t_ns, unless returned before. `i`: index of the camera in the
    /// scenario.
    [[nodiscard]] std::optional<Frame> newest_frame(std::size_t i, std::int64_t t_ns) {
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
    /// The turn that ends at t_ns; false: its last packet has not arrived.
    [[nodiscard]] bool turn(std::size_t i, std::int64_t t_ns, LidarSweep& out) {
        const std::lock_guard lock(mutex_);
        const SweepBuffer& buffer = inputs_.lidars[i].buffer;
        buffer.turn(t_ns, out);
        return buffer.complete_to(t_ns);
    }
    [[nodiscard]] std::uint64_t frames() const {
        const std::lock_guard lock(mutex_);
        return frames_;
    }

private:
    struct Arrived {
        std::int64_t t_arrived_ns = 0;  ///< CLOCK_MONOTONIC
        std::vector<std::uint8_t> bytes;
    };
    struct CameraState {
        std::deque<Arrived> arrived;
        std::deque<FrameNotice> notices;
        std::int64_t taken_ns = std::numeric_limits<std::int64_t>::min();
    };
    void read_frames(std::size_t i) {
        CameraInput& input = inputs_.cameras[i];
        std::vector<std::uint8_t> bytes(input.frame_bytes);
        while (!stop_ && input.source->status()) {
            if (!input.source->receive(bytes, kReadWait_ns)) continue;
            const std::int64_t now_ns = monotonic_ns();
            const std::lock_guard lock(mutex_);
            ++frames_;
            auto& arrived = cameras_[i].arrived;
            if (arrived.size() == kFramesKept) arrived.pop_front();
            arrived.push_back({now_ns, bytes});
        }
    }
    void read_packets(std::size_t i) {
        LidarInput& input = inputs_.lidars[i];
        std::vector<std::uint8_t> packet(kDatagramBytesMax);
        while (!stop_) {
            const std::size_t n = input.source->receive(packet, kReadWait_ns);
            if (n == 0) continue;
            const std::lock_guard lock(mutex_);
            input.buffer.take({packet.data(), n}, monotonic_ns() + offset_ns_);
        }
    }
    /// Mid-exposure, from the embedded line or from the notice whose hand-over is nearest to the arrival.
    [[nodiscard]] std::optional<std::int64_t> exposed_ns(const CameraState& state, const Camera& camera,
                                                         const Arrived& frame) const {
        if (camera.embedded_line) {
            const std::size_t row = frame.bytes.size() / static_cast<std::size_t>(camera.height);
            const auto ledger = decode_embedded_line(std::span(frame.bytes).last(row));
            return ledger ? std::optional(ledger->t_exposure_mid_ns) : std::nullopt;
        }
        const FrameNotice* nearest = nullptr;
        std::int64_t min_ns = camera.period_ns / 2;
        for (const FrameNotice& notice : state.notices) {
            const std::int64_t off_ns = std::abs(frame.t_arrived_ns + offset_ns_ - notice.t_hand_over_ns);
            if (off_ns < min_ns) nearest = &notice, min_ns = off_ns;
        }
        std::optional<std::int64_t> mid_ns;
        if (nearest && nearest->delivery == Delivery::frame) mid_ns = nearest->t_mid_ns;
        return mid_ns;
    }

    SensorInputs& inputs_;
    const SceneModel& model_;
    StopFlag stop_{false};
    mutable std::mutex mutex_;  ///< guards the members below and the LiDARs' buffers
    std::vector<CameraState> cameras_;
    std::int64_t offset_ns_ = 0;
    std::uint64_t frames_ = 0;
    std::vector<std::thread> threads_;
};

class RealTimeLoop {
public:
    explicit RealTimeLoop(const Loop& loop)
        : loop_(loop),
          receiver_(loop.inputs, loop.autopilot.model()),
          period_ns_(loop.autopilot.scenario().period_ns()) {}

    Status fly() {
        if (auto began = wait_for_the_start(); !began || loop_.over()) return began;
        t_start_ns_ = loop_.link.dynamics()->t_start_ns;
        if (auto started = loop_.autopilot.start(t_start_ns_, *loop_.link.attitude()); !started) return started;
        std::thread measuring([this] { measure(); });
        Status flown = run_cycles();
        {
            const std::lock_guard lock(mutex_);
            over_ = true;
        }
        changed_.notify_all();
        measuring.join();
        loop_.counts.frames = receiver_.frames();
        return flown;
    }

private:
    void receive(std::int64_t timeout_ns) {
        loop_.link.receive(timeout_ns);
        receiver_.update(loop_.link.take_notices(), loop_.link.clock().now_ns() - monotonic_ns());
    }

    Status wait_for_the_start() {
        const std::int64_t deadline = monotonic_ns() + kTimeout_ns;
        while (!loop_.over()) {
            receive(20 * kMs);
            if (loop_.link.clock().synchronized() && loop_.link.dynamics() && loop_.link.attitude()) return Ok{};
            if (monotonic_ns() > deadline)
                return loop_.failed(
                    fmt::format("{} in {} s: are `narpa run` and the dynamics there?",
                                loop_.link.clock().synchronized() ? "no report of the dynamics" : "no heartbeat",
                                kTimeout_ns / kSecond_ns));
        }
        return Ok{};
    }

    Status run_cycles() {
        take_fifo_priority(kCyclePriority);  // this thread alone: the measuring thread computes for long
        for (std::int64_t t_ns = t_start_ns_;; t_ns += period_ns_) {
            if (auto there = wait_until(t_ns); !there || loop_.over()) return there;
            const std::int64_t late_ns = loop_.link.clock().now_ns() - t_ns;
            if (late_ns > period_ns_) {
                const std::int64_t passed = late_ns / period_ns_;
                loop_.counts.cycles_passed_over += static_cast<std::uint64_t>(passed);
                t_ns += passed * period_ns_;
            } else if (late_ns > kReportWait_ns + period_ns_ / 10) {
                ++loop_.counts.cycles_late;
            }
            loop_.take_beams(t_ns);
            loop_.publish(loop_.autopilot.cycle(t_ns, kCommandLead_ns));
        }
    }

    /// Waits until the clock shows t_ns and the attitude of that time has arrived, for at most kReportWait_ns
    /// longer.
    Status wait_until(std::int64_t t_ns) {
        while (!loop_.over()) {
            const std::int64_t left_ns = t_ns - loop_.link.clock().now_ns();
            const bool reported = pass_attitude() >= t_ns;
            if (left_ns <= 0 && (reported || -left_ns > kReportWait_ns)) return Ok{};
            receive(std::clamp<std::int64_t>(left_ns, 1 * kMs, 20 * kMs));
            if (auto there = emulator_is_there(); !there) return there;
        }
        return Ok{};
    }

    Status emulator_is_there() const {
        const RemoteClock& clock = loop_.link.clock();
        if (loop_.over()) return Ok{};  // the run may end here
        if (clock.stopping()) return loop_.failed("the emulator has stopped before the dynamics reported the end");
        if (static_cast<double>(clock.silence_ns()) > 1e9 * loop_.silence_s)
            return loop_.failed(fmt::format("no heartbeat of the emulator for {:g} s", loop_.silence_s));
        return Ok{};
    }

    /// Passes the newest attitude to the autopilot and wakes the measuring thread; returns its time.
    std::int64_t pass_attitude() {
        const AttitudeReport& attitude = *loop_.link.attitude();
        if (attitude.t_ns > t_attitude_ns_ || attitude.t_ns == t_start_ns_) {
            loop_.autopilot.take(attitude);
            loop_.autopilot.take(loop_.link.dynamics()->phase, attitude.t_ns);
            {
                const std::lock_guard lock(mutex_);
                t_attitude_ns_ = attitude.t_ns;
            }
            changed_.notify_all();
        }
        return attitude.t_ns;
    }

    /// Body of the measuring thread.
    void measure() {
        const SingleThreadedOpenCv pictures;
        tbb::task_arena arena;
        std::int64_t done_ns = t_start_ns_;
        for (;;) {
            std::int64_t t_ns = 0;
            {
                std::unique_lock lock(mutex_);
                changed_.wait(lock, [&] { return over_ || t_attitude_ns_ > done_ns; });
                if (over_) return;
                t_ns = t_attitude_ns_;
                changed_.wait_for(lock, std::chrono::nanoseconds(kSensorWait_ns), [&] { return over_; });
                if (over_) return;
            }
            arena.execute([&] { measure_at(t_ns); });
            done_ns = t_ns;
        }
    }

    void measure_at(std::int64_t t_ns) {
        for (std::size_t i = 0; i < loop_.inputs.lidars.size(); ++i) {
            if (!receiver_.turn(i, t_ns, sweep_)) ++loop_.counts.turns_incomplete;
            if (!sweep_.points.empty()) loop_.autopilot.take_sweep(i, t_ns, sweep_);
        }
        for (std::size_t i = 0; i < loop_.inputs.cameras.size(); ++i) {
            const auto frame = receiver_.newest_frame(i, t_ns);
            if (!frame) {
                ++loop_.counts.frames_missing;
                continue;
            }
            loop_.take_frame(i, frame->t_mid_ns, frame->bytes);
        }
    }

    const Loop& loop_;
    SensorReceiver receiver_;
    std::int64_t period_ns_, t_start_ns_ = 0;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::int64_t t_attitude_ns_ = std::numeric_limits<std::int64_t>::min();
    bool over_ = false;
    LidarSweep sweep_;
};

}  // namespace

Status fly_in_real_time(const Loop& loop) {
    return RealTimeLoop(loop).fly();
}

}  // namespace narpa::rehearsal
