// emulator/loop.cpp - the loops. In real time every sensor has a thread that waits for its absolute deadline,
// renders and publishes, and one thread serves the CAN bus. In lockstep one thread does it all, and the clock is
// the bus: it stands still until every commanded body has a command for the time to come.
#include <tbb/task_arena.h>

#include <algorithm>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <thread>

#include "emulator/emulator.h"
#include "emulator/realtime.h"
#include "emulator/threads.h"
#include "estimator/features/feature_matcher.h"

namespace narpa {
namespace {

constexpr std::int64_t kHeartbeatPeriodNs = 100'000'000;
constexpr std::int64_t kStartLeadNs = 50'000'000;
constexpr std::int64_t kBusWaitNs = 2'000'000;  // how long a ledger may wait for the bus thread
constexpr int kFramesPerTurn = 4096;            // bounds a turn of the bus thread on a saturated bus
constexpr int kBusPriority = 60, kLidarPriority = 55, kCameraPriority = 50, kTracingPriority = 49;

}  // namespace

/// Where the threads of a run wait for each other, so that the clock starts when all are ready.
class StartLine {
public:
    explicit StartLine(std::size_t runners) : missing_(runners) {}

    /// Says so, and waits for the start.
    void ready() {
        std::unique_lock lock(mutex_);
        --missing_;
        changed_.notify_all();
        changed_.wait(lock, [&] { return started_; });
    }
    void wait_until_all_are_ready() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return missing_ == 0; });
    }
    void go() {
        const std::lock_guard lock(mutex_);
        started_ = true;
        changed_.notify_all();
    }

private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::size_t missing_;
    bool started_ = false;
};

// --- Real time ------------------------------------------------------------

void Emulator::run_real_time(const StopFlag& stop) {
    if (!lock_memory()) notices_.push_back("memory is not locked (not permitted): page faults may cost deadlines");
    threads_->make_real_time(kTracingPriority);
    StartLine start(cameras_.size() + lidars_.size() + (can_ ? 1 : 0));
    StopFlag sensors_done{false}, estimates_done{false};
    std::thread bus;
    if (can_) bus = std::thread([&] { run_bus(start, estimates_done); });
    std::thread estimator;
    if (estimates_) estimator = std::thread([&] { run_estimator(sensors_done); });
    std::vector<std::thread> sensors;
    for (const auto& feed : lidars_) sensors.emplace_back([&, f = feed.get()] { run_lidar(*f, start, stop); });
    for (const auto& feed : cameras_) sensors.emplace_back([&, f = feed.get()] { run_camera(*f, start, stop); });
    start.wait_until_all_are_ready();
    clock_ = std::make_unique<Clock>(kStartLeadNs);
    start.go();
    (void)clock_->wait_until(0, stop);
    const PageFaults before = narpa::page_faults();
    for (std::thread& t : sensors) t.join();
    const PageFaults after = narpa::page_faults();
    page_faults_ = {after.minor - before.minor, after.major - before.major};
    sensors_done = true;
    if (estimator.joinable()) estimates_->wake(), estimator.join();
    estimates_done = true;
    if (bus.joinable()) bus.join();
}

// A sensor's first frames and packets pay for everything that is only needed once, and show how long the next will
// take: so they are made before the clock runs, by the thread and at the priority that makes the next.

void Emulator::run_camera(CameraFeed& feed, StartLine& start, const StopFlag& stop) {
    name_thread("narpa-camera");
    touch_stack();
    if (!take_fifo_priority(kCameraPriority)) no_priority_ = true;
    if (&feed == cameras_.front().get()) threads_->gather();
    threads_->arena.execute([&] { feed.warm_up(); });
    start.ready();
    while (feed.next_mid_ns() < end_ns_ && clock_->wait_until(feed.due_ns(), stop)) {
        threads_->arena.execute([&] { feed.make_next(clock_.get(), end_ns_); });
        t_ns_.store(clock_->now_ns(), std::memory_order_relaxed);
    }
}

void Emulator::run_lidar(LidarFeed& feed, StartLine& start, const StopFlag& stop) {
    name_thread("narpa-lidar");
    touch_stack();
    if (!take_fifo_priority(kLidarPriority)) no_priority_ = true;
    feed.warm_up();
    start.ready();
    while (feed.due_ns() <= end_ns_ && clock_->wait_until(feed.due_ns(), stop)) feed.make_next(clock_.get());
}

void Emulator::run_bus(StartLine& start, const StopFlag& stop) {
    name_thread("narpa-can");
    touch_stack();
    if (!take_fifo_priority(kBusPriority)) no_priority_ = true;
    start.ready();
    std::int64_t next_heartbeat = 0;
    while (!stop.load(std::memory_order_relaxed)) {
        can_->wait(clock_->now_ns(), kBusWaitNs);
        const std::int64_t now = clock_->now_ns();
        t_ns_.store(now, std::memory_order_relaxed);
        bool moved = false;
        for (int i = 0; i < kFramesPerTurn && can_->receive(now, moved); ++i) {
        }
        send_ledgers(now);
        send_estimates(now);
        // Nothing more will be commanded. Said once: a camera that is always behind would never get to an end that
        // moves on with the time.
        if (end_ns_ == std::numeric_limits<std::int64_t>::max() && can_->ended()) end_ns_ = now;
        if (now >= next_heartbeat) {
            send_heartbeat(now, RunState::running);
            next_heartbeat += kHeartbeatPeriodNs;
        }
    }
    send_ledgers(clock_->now_ns());
    send_estimates(clock_->now_ns());
    send_heartbeat(clock_->now_ns(), RunState::stopping);
}

/// Without priority, on one thread: it takes what the sensors leave.
void Emulator::run_estimator(const StopFlag& stop) {
    name_thread("narpa-estimate");
    const OnePictureThread pictures;  // workers with the sensors' priority would help, and hold the sensors up
    tbb::task_arena alone(1);
    alone.execute([&] { estimates_->run(stop); });
}

// --- Lockstep ------------------------------------------------------------

void Emulator::run_lockstep(const StopFlag& stop) {
    bool started = false;
    bool moved = false;
    send_heartbeat(0, RunState::starting);
    while (!stop.load(std::memory_order_relaxed) && t_ns() < end_ns_) {
        if (!can_->receive(t_ns(), moved)) {
            if (can_->bus().ended()) break;
            can_->bus().wait(100'000'000);
            continue;
        }
        if (!moved || !can_->commanded()) continue;
        if (!started) {
            for (const auto& feed : cameras_) feed->start_at(can_->first_ns());
            for (const auto& feed : lidars_) feed->start_at(can_->first_ns());
            started = true;
        }
        advance_to(std::min(can_->granted_ns(), end_ns_.load()), stop);
        send_heartbeat(t_ns(), RunState::lockstep);
    }
    send_heartbeat(t_ns(), RunState::stopping);
}

/// Makes every frame and packet that falls due up to t, in the order of time.
void Emulator::advance_to(std::int64_t t_ns, const StopFlag& stop) {
    while (!stop.load(std::memory_order_relaxed)) {
        const auto earlier_frame = [](const auto& a, const auto& b) { return a->next_mid_ns() < b->next_mid_ns(); };
        const auto earlier_packet = [](const auto& a, const auto& b) { return a->due_ns() < b->due_ns(); };
        const auto camera = std::min_element(cameras_.begin(), cameras_.end(), earlier_frame);
        const auto lidar = std::min_element(lidars_.begin(), lidars_.end(), earlier_packet);
        constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
        const std::int64_t t_camera = camera == cameras_.end() ? kNever : (*camera)->next_mid_ns();
        const std::int64_t t_lidar = lidar == lidars_.end() ? kNever : (*lidar)->due_ns();
        // The run ends before the frame at `end` and after the packet that is complete by then.
        if (std::min(t_camera, t_lidar) > t_ns || (t_camera >= end_ns_ && t_lidar > end_ns_)) break;
        if (t_lidar <= t_camera) {
            (*lidar)->make_next(nullptr);
        } else if (t_camera < end_ns_) {
            threads_->arena.execute([&] { (*camera)->make_next(nullptr, end_ns_); });
            send_ledgers(t_camera);
            send_estimates(t_camera);
        } else {
            break;
        }
    }
    t_ns_.store(std::max(this->t_ns(), t_ns), std::memory_order_relaxed);
}

// --- Telemetry ------------------------------------------------------------

void Emulator::send_ledgers(std::int64_t t_ns) noexcept {
    FrameLedger ledger;
    for (const auto& feed : cameras_) {
        while (feed->ledgers().pop(ledger)) {
            faults_.stale |= ledger.pose_stale;
            faults_.deadline_missed |= !ledger.deadline_met;
            can_->send(ledger, t_ns);
        }
    }
}

void Emulator::send_estimates(std::int64_t t_ns) noexcept {
    EstimateReport report;
    while (estimates_ && estimates_->reports().pop(report)) can_->send(report, t_ns);
}

/// Faults are those since the last heartbeat.
void Emulator::send_heartbeat(std::int64_t t_ns, RunState state) noexcept {
    Heartbeat heartbeat = faults_;
    heartbeat.t_ns = t_ns;
    heartbeat.state = state;
    heartbeat.no_command = !can_->commanded();
    const std::uint64_t drops = output_drops();
    heartbeat.output_dropped = drops != drops_told_;
    drops_told_ = drops;
    faults_ = {};
    can_->send(heartbeat, t_ns);
}

std::uint64_t Emulator::output_drops() const noexcept {
    std::uint64_t n = 0;
    for (const auto& feed : cameras_)
        for (const auto& sink : feed->sinks()) {
            const VideoCounters c = sink->counters();
            n += c.ring_full + c.no_reader + c.failed;
        }
    for (const auto& feed : lidars_)
        for (const auto& sink : feed->sinks()) n += sink->counters().dropped;
    return n;
}

}  // namespace narpa
