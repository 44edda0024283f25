// emulator/loop.cpp - the two loops over the table of sensors. In real time each sensor has a thread that waits for
// the absolute due time of its next item, and one thread serves the CAN bus. In lockstep one thread does
// everything: the simulation clock advances only when every commanded body has a command for the time to come.
#include <tbb/task_arena.h>

#include <algorithm>
#include <barrier>
#include <cassert>
#include <limits>
#include <semaphore>
#include <thread>
#include <utility>

#include "base/time.h"
#include "emulator/emulator.h"
#include "emulator/realtime.h"
#include "emulator/threads.h"

namespace narpa {
namespace {

constexpr std::int64_t kStartLeadNs = 50'000'000;
constexpr std::int64_t kBusWaitNs = 2'000'000;           // the longest that a ledger waits for the CAN thread
constexpr std::int64_t kLockstepWaitNs = 100'000'000;    // between two checks of the stop flag
constexpr std::int64_t kStartingPeriodNs = 500'000'000;  // of heartbeats until a lockstep run begins, wall time
constexpr int kCommanderGraceWaits = 10;  // times kLockstepWaitNs: grace period after the last commander has left
constexpr int kSecondPriority = 61, kBusPriority = 60, kTracingPriority = 49;  // the sensors' lie between

/// Calls f on the threads on which the sensor works.
void execute(const Sensor& sensor, TracingThreads& threads, const auto& f) {
    sensor.thread().in_arena ? threads.arena.execute(f) : f();
}

/// Waits until the sensor's next item is due. False: the run has ended.
bool wait_for_item(Sensor& sensor, const RealTimeClock& clock, const StopFlag& stop) {
    while (!stop.load(std::memory_order_relaxed)) {
        sensor.plan();
        const std::int64_t now = clock.now_ns(), t_pose = sensor.last_pose_ns(), due = sensor.due_ns();
        if ((t_pose == Clock::kNever ? now : t_pose) >= clock.end_ns()) return false;
        if (now >= due) return true;
        (void)clock.wait_until(std::min(due, now + sensor.schedule_holds_ns()), stop);
    }
    return false;
}

struct StartClock {
    RealTimeClock& clock;
    void operator()() const noexcept { clock.start(kStartLeadNs); }
};

}  // namespace

/// What the threads of a real-time run share. The clock starts when all of them are at the barrier.
struct Emulator::RealTimeRun {
    RealTimeRun(std::size_t threads, std::size_t bodies, SystemUtc* utc)
        : clock(utc), start(static_cast<std::ptrdiff_t>(threads), StartClock{clock}) {
        refusals.bodies.reserve(bodies);
    }
    RealTimeClock clock;
    std::barrier<StartClock> start;
    /// The first refusals, which the CAN thread leaves to another to report.
    PoseRefusals refusals{};
    bool refused = false;
    std::counting_semaphore<2> to_report{0};  ///< released with `refused`, and at the end
};

// --- Telemetry ------------------------------------------------------------

void Emulator::send_telemetry(std::int64_t t_ns) noexcept {
    if (!can_) return;
    for (const auto& sensor : sensors_.all) sensor->send_telemetry(*can_, t_ns, faults_);
    for (const auto& feed : observers_) feed->observer().send_telemetry(*can_, t_ns);
}

void Emulator::send_heartbeat(std::int64_t t_ns, RunState state) noexcept {
    if (!can_) return;
    std::uint64_t drops = 0;
    for (const auto& sensor : sensors_.all) drops += sensor->drops();
    Heartbeat heartbeat = std::exchange(faults_, {});
    heartbeat.t_ns = t_ns;
    heartbeat.state = state;
    heartbeat.no_command = !can_->commanded();
    heartbeat.output_dropped = std::exchange(drops_reported_, drops) != drops;
    can_->send(heartbeat, t_ns);
}

// --- Real time ------------------------------------------------------------

void Emulator::run_real_time(const StopFlag& stop) {
    if (!lock_memory()) notices_.push_back("memory is not locked (not permitted): page faults may cost deadlines");
    threads_->make_real_time(kTracingPriority);
    RealTimeRun run(1 + sensors_.all.size() + (can_ ? 1 : 0) + (second_pulses_ ? 1 : 0),
                    can_ ? can_->commanded_bodies() : 0, system_utc_.get());
    run.clock.set_epoch(world_->scene().epoch_unix_ns);
    run.clock.end_at(end_ns_);
    StopFlag sensors_done{false}, observers_done{false};
    std::thread bus;
    if (can_) bus = std::thread([&] { run_bus(run, observers_done); });
    std::thread seconds;
    if (second_pulses_)
        seconds = std::thread([&] {
            become_real_time("narpa-pps", kSecondPriority);
            run.start.arrive_and_wait();
            second_pulses_->run(run.clock, sensors_done);
        });
    std::thread notifier([&] {
        name_thread("narpa-notes");
        run.to_report.acquire();
        if (run.refused) report_refusals(run.refusals);
    });
    std::vector<std::thread> sensors, observers;
    for (const auto& feed : observers_)
        observers.emplace_back([&, f = feed.get()] { run_observer(*f, sensors_done); });
    for (const auto& sensor : sensors_.all)
        sensors.emplace_back([&, s = sensor.get()] { run_sensor(*s, run, stop); });
    run.start.arrive_and_wait();
    (void)run.clock.wait_until(0, stop);
    const PageFaults before = narpa::page_faults();
    for (std::thread& t : sensors) t.join();
    const PageFaults after = narpa::page_faults();
    page_faults_ = {after.minor - before.minor, after.major - before.major};
    sensors_done = true;
    for (const auto& feed : observers_) feed->wake();
    for (std::thread& t : observers) t.join();
    observers_done = true;
    if (bus.joinable()) bus.join();
    if (seconds.joinable()) seconds.join();
    run.to_report.release();
    notifier.join();
    t_ns_ = std::min(run.clock.now_ns(), run.clock.end_ns());
    utc_ = run.clock.utc();
}

void Emulator::become_real_time(const char* name, int priority) {
    name_thread(name);
    touch_stack();
    if (!take_fifo_priority(priority)) no_priority_ = true;
}

void Emulator::run_sensor(Sensor& sensor, RealTimeRun& run, const StopFlag& stop) {
    const SensorThread thread = sensor.thread();
    become_real_time(thread.name, thread.priority);
    // The first sensor that needs the tracing threads waits until all of them are there.
    const auto traces = [](const auto& s) { return s->thread().in_arena; };
    const auto first = std::ranges::find_if(sensors_.all, traces);
    if (first != sensors_.all.end() && &sensor == first->get()) threads_->gather();
    execute(sensor, *threads_, [&] { sensor.warm_up(); });
    run.start.arrive_and_wait();
    while (wait_for_item(sensor, run.clock, stop)) {
        execute(sensor, *threads_, [&] { sensor.make_next(run.clock); });
        t_ns_.store(run.clock.now_ns(), std::memory_order_relaxed);
    }
}

void Emulator::run_bus(RealTimeRun& run, const StopFlag& stop) {
    become_real_time("narpa-can", kBusPriority);
    RealTimeClock& clock = run.clock;
    run.start.arrive_and_wait();
    std::int64_t next_heartbeat = 0, next_time = 0;
    while (!stop.load(std::memory_order_relaxed)) {
        const std::int64_t before = clock.now_ns();
        can_->wait(before, std::clamp<std::int64_t>(next_time - before, 0, kBusWaitNs));
        const std::int64_t now = clock.now_ns();
        next_time = send_time(clock, now);
        take_pulses(clock);
        t_ns_.store(now, std::memory_order_relaxed);
        bool moved = false;
        for (int i = 0; i < kFramesPerTurn && can_->receive(now, moved); ++i) {
        }
        send_telemetry(now);
        if (can_->refuses_poses() && !std::exchange(run.refused, true)) {
            can_->refusals(run.refusals);
            run.to_report.release();
        }
        // A recorded bus has ended: so does the run. Set once, because an overloaded camera never reaches an end
        // that advances with the time.
        if (clock.end_ns() == Clock::kNever && can_->ended()) clock.end_at(now);
        if (can_->restart() && clock.end_ns() > now) clock.end_at(now);
        if (now >= next_heartbeat) {
            send_heartbeat(now, RunState::running);
            next_heartbeat = next_due_ns(next_heartbeat, kHeartbeatPeriodNs, now);
        }
    }
    send_telemetry(clock.now_ns());
    if (!can_->restart()) send_heartbeat(clock.now_ns(), RunState::stopping);
}

void Emulator::take_pulses(const RealTimeClock& clock) noexcept {
    const std::int64_t zero_ns = clock.to_monotonic(0);
    for (const auto& source : triggers_)
        for (int i = 0; i < kFramesPerTurn; ++i) {
            const auto t_ns = source->receive();
            if (!t_ns) break;
            can_->expose(TriggerMode::external, {*t_ns - zero_ns, clock.now_ns()});
        }
}

std::int64_t Emulator::send_time(const RealTimeClock& clock, std::int64_t now_ns) noexcept {
    const CanSettings& settings = world_->scene().can;
    std::int64_t next_ns = Clock::kNever;
    const auto due = [&](std::int64_t& at_ns, std::int64_t period_ns) {
        const bool is_due = now_ns >= at_ns;
        if (is_due) at_ns = next_due_ns(at_ns, period_ns, now_ns);
        next_ns = std::min(next_ns, at_ns);
        return is_due;
    };
    // SYNC first: receivers take its arrival for the time.
    if (settings.sync_period_ns > 0 && due(next_time_.sync_ns, settings.sync_period_ns)) can_->send_sync(now_ns);
    if (settings.time_period_ns > 0 && due(next_time_.time_ns, settings.time_period_ns))
        can_->send(canopen_time(settings.time_id, clock.utc().zero_unix_ns + clock.now_ns()), now_ns);
    if (system_utc_ && now_ns >= 0) {
        if (const std::uint32_t steps = system_utc_->steps(); steps != std::exchange(next_time_.steps, steps))
            next_time_.report_ns = now_ns;
        if (due(next_time_.report_ns, kSecond_ns)) can_->send_numbered(clock_report(clock), now_ns);
    }
    return next_ns;
}

ClockReport Emulator::clock_report(const RealTimeClock& clock) const noexcept {
    const RunUtc utc = clock.utc();
    const ClockDiscipline discipline = read_clock_discipline();
    return {.zero_utc_s = static_cast<std::uint32_t>(utc.zero_unix_ns / kSecond_ns),
            .zero_utc_fraction_s = 1e-9 * static_cast<double>(utc.zero_unix_ns % kSecond_ns),
            .state = discipline.synchronised ? UtcState::synchronised : UtcState::not_synchronised,
            .leap_second_today = discipline.leap_second_today,
            .steps = static_cast<std::uint8_t>(system_utc_->steps()),
            .tai_less_utc_s = static_cast<std::int16_t>(discipline.tai_less_utc_s),
            .error_s = discipline.error_ns >= 0 ? 1e-9 * static_cast<double>(discipline.error_ns)
                                                : std::numeric_limits<double>::quiet_NaN(),
            .frequency_ppm = 1e-3 * static_cast<double>(discipline.frequency_ppb)};
}

/// Without real-time priority, on one thread: it uses the time that the sensors leave.
void Emulator::run_observer(FrameFeed& feed, const StopFlag& stop) {
    name_thread(("narpa-" + std::string(feed.observer().name())).c_str());
    tbb::task_arena alone(1);
    alone.execute([&] { feed.run(stop); });
}

// --- Lockstep ------------------------------------------------------------

void Emulator::begin() {
    lockstep_.clock.end_at(end_ns_);
    send_heartbeat(0, RunState::starting);
}

void Emulator::run_lockstep(const StopFlag& stop) {
    begin();
    make_items(Clock::kNever, stop);  // of the command with which a run begins that follows another
    const bool waits_for_others = world_->scene().time.on_restart == TimeSettings::OnRestart::new_run;
    int waits_alone = 0;
    std::int64_t repeated_ns = monotonic_ns();
    while (!stop.load(std::memory_order_relaxed) && t_ns() < end_ns_) {
        if (!lockstep_.started && monotonic_ns() - repeated_ns > kStartingPeriodNs) {
            can_->repeat_heartbeat();
            repeated_ns = monotonic_ns();
        }
        const bool taken = take_frame();
        if (can_->restart()) return;
        if (!taken) {
            if (can_->bus().ended()) break;
            const bool left = !waits_for_others && can_->hub() && can_->hub()->commanders_left();
            waits_alone = left ? waits_alone + 1 : 0;
            if (waits_alone > kCommanderGraceWaits) {
                notices_.push_back("the last client that sent commands has left the bus: the run has ended");
                abandoned_ = end_ns_ != Clock::kNever;
                break;
            }
            can_->bus().wait(kLockstepWaitNs);
            continue;
        }
        make_items(Clock::kNever, stop);
    }
    send_heartbeat(t_ns(), RunState::stopping);
}

void Emulator::advance(std::int64_t until_ns, const StopFlag& stop) {
    while (!stop.load(std::memory_order_relaxed) && take_frame()) {
    }
    lockstep_.moved = true;  // an earlier command may reach beyond the last `until_ns`
    make_items(until_ns, stop);
}

Status Emulator::end() {
    send_heartbeat(t_ns(), RunState::stopping);
    return finish();
}

bool Emulator::take_frame() {
    if (!can_->receive(t_ns(), lockstep_.moved)) return false;
    if (can_->refuses_poses() && !std::exchange(lockstep_.refused, true)) {
        PoseRefusals refusals;
        can_->refusals(refusals);
        report_refusals(refusals);
    }
    return true;
}

void Emulator::make_items(std::int64_t until_ns, const StopFlag& stop) {
    if (!lockstep_.moved || !can_->commanded()) return;
    if (!std::exchange(lockstep_.started, true))
        for (const auto& sensor : sensors_.all) sensor->start_at(can_->first_ns());
    advance_to(std::min({can_->granted_ns(), end_ns_, until_ns}), lockstep_.clock, stop);
    send_heartbeat(t_ns(), RunState::lockstep);
}

/// Makes every item whose poses are commanded by `t_ns`, in the order of time.
void Emulator::advance_to(std::int64_t t_ns, LockstepClock& clock, const StopFlag& stop) {
    const auto last_pose = [](const auto& sensor) { return sensor->last_pose_ns(); };
    while (!stop.load(std::memory_order_relaxed)) {
        for (const auto& sensor : sensors_.all) sensor->plan();
        Sensor& next = **std::ranges::min_element(sensors_.all, {}, last_pose);
        const std::int64_t t_pose = next.last_pose_ns();
        if (t_pose > t_ns || t_pose >= clock.end_ns()) break;
        assert(next.due_ns() >= t_pose && "an item is made once its poses are known");
        clock.set(next.due_ns());
        execute(next, *threads_, [&] { next.make_next(clock); });
        send_telemetry(t_pose);
    }
    t_ns_.store(std::max(this->t_ns(), t_ns), std::memory_order_relaxed);
}

}  // namespace narpa
