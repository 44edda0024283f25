#include "rehearsal/dynamics/node.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "base/write_file.h"
#include "drivers/can/remote_clock.h"
#include "drivers/descriptor.h"
#include "protocols/can/messages.h"
#include "rehearsal/dynamics/flight_log.h"
#include "rehearsal/dynamics/simulation.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kShortWaitNs = 20'000'000;
/// In real time poses are sent this long before their time of validity, so that a frame of that time uses that
/// pose.
constexpr std::int64_t kLeadNs = 5'000'000;
constexpr double kSiteOff_m = 0.5;
constexpr const char* kConnectionLost = "the connection to the emulator was lost";
constexpr std::int64_t kHeadStartNs = 500'000'000;  // least time from the first heartbeat to time 0

/// A body's pose commands.
struct CommandedBody {
    std::string name;
    std::uint32_t base_id = 0;
    std::uint8_t counter = 0;
};

/// Actuator commands by outcome.
struct CommandCounts {
    std::uint64_t applied = 0;
    std::uint64_t lost = 0;     ///< by the scenario's fault
    std::uint64_t late = 0;     ///< arrived more than a period after their time
    std::uint64_t refused = 0;  ///< unexpected time, or not newer than the last
};

class Node {
public:
    Node(const Scenario& scenario, const DynamicsOptions& options, std::shared_ptr<const Terrain> terrain,
         std::optional<TruthLog> log, CanBus& bus, const StopFlag& stop)
        : scenario_(scenario),
          options_(options),
          simulation_(scenario, options.seed, std::move(terrain)),
          log_(std::move(log)),
          bus_(bus),
          stop_(stop),
          fd_(bus.carries_fd()),
          target_{scenario.target.body, scenario.target.can_id},
          chaser_{scenario.chaser.body, scenario.chaser.can_id} {
        if (scenario.attractor) attractor_ = CommandedBody{scenario.attractor->first, scenario.attractor->second};
    }

    Status run() {
        Status flown = options_.lockstep ? run_in_lockstep() : run_in_real_time();
        if (!flown) return flown;
        return log_ ? log_->close() : Status{Ok{}};
    }
    [[nodiscard]] nlohmann::json report() const;

private:
    // --- Lockstep ---
    Status run_in_lockstep() {
        for (;;) {
            if (auto sent = send_period(); !sent || over_) return sent ? wait_for_emulator() : sent;
            if (auto commanded = wait_for_command(); !commanded || stop_) return commanded;
            const std::int64_t next_ns = simulation_.t_ns() + scenario_.period_ns();
            while (simulation_.t_ns() < next_ns) {
                if (auto moved = advance_to(next_pose_ns()); !moved) return moved;
                if (simulation_.t_ns() == next_ns) break;  // the poses of this time follow the report
                if (auto sent = send_poses(); !sent) return sent;
            }
        }
    }

    Status wait_for_command() {
        return wait([&] { return commanded_ns_ == clock_time_ns(); },
                    [&] { return fmt::format("no actuator command for {:.3f} s", now_s()); });
    }
    Status wait_for_emulator() {
        return wait([&] { return clock_.reached(clock_time_ns()); },
                    [&] { return fmt::format("no heartbeat of {:.3f} s", now_s()); });
    }

    template <class Done, class What>
    Status wait(const Done& done, const What& what) {
        const std::int64_t deadline_ns = monotonic_ns() + std::llround(options_.patience_s * 1e9);
        for (;;) {
            if (auto received = receive(); !received) return received;
            if (done() || stop_) return Ok{};
            if (clock_.stopping()) return failed(what() + ": the emulator has stopped");
            if (connection_lost()) return failed(what() + ": " + kConnectionLost);
            if (monotonic_ns() > deadline_ns) return failed(what() + fmt::format(" in {} s", options_.patience_s));
            bus_.wait(kShortWaitNs);
        }
    }

    // --- Real time ---
    Status run_in_real_time() {
        if (auto ready = synchronize(); !ready || stop_) return ready;
        for (;; next_ns_ += scenario_.pose_period_ns()) {
            if (auto waited = wait_until(t_start_ns_ + next_ns_ - kLeadNs); !waited || stop_) return waited;
            if (auto moved = advance_to(next_ns_); !moved) return moved;
            const bool period = next_ns_ % scenario_.period_ns() == 0;
            if (auto sent = period ? send_period() : send_poses(); !sent || over_) return sent;
        }
    }

    /// Sets time 0 to a whole second of the emulator's clock.
    Status synchronize() {
        const std::int64_t deadline_ns = monotonic_ns() + std::llround(options_.wait_s * 1e9);
        while (!clock_.synchronized() && !stop_) {
            if (monotonic_ns() > deadline_ns)
                return failed(fmt::format("no heartbeat in {} s: is `narpa run` there?", options_.wait_s));
            bus_.wait(kShortWaitNs);
            clock_.listen(bus_);
        }
        t_start_ns_ = (clock_.now_ns() + kHeadStartNs + kSecond_ns - 1) / kSecond_ns * kSecond_ns;
        return Ok{};
    }

    /// Commands that arrive meanwhile take effect at their time, or at once if that is past. Returns early when
    /// stopped.
    Status wait_until(std::int64_t t_ns) {
        for (;;) {
            if (auto received = receive(); !received) return received;
            if (stop_) return Ok{};
            if (clock_.stopping()) return failed(fmt::format("at {:.3f} s: the emulator has stopped", now_s()));
            if (static_cast<double>(clock_.silence_ns()) > 1e9 * options_.silence_s)
                return failed(fmt::format("at {:.3f} s: no heartbeat of the emulator for {:g} s", now_s(),
                                          options_.silence_s));
            const std::int64_t left_ns = t_ns - clock_.now_ns();
            if (left_ns <= 0) return Ok{};
            bus_.wait(std::min(left_ns, 5 * kShortWaitNs));
        }
    }

    // --- Commands in ---
    Status receive() {
        ReceivedFrame received;
        for (int i = 0; i < kFramesPerTurn && bus_.receive(received); ++i) {
            if (clock_.accept(received)) continue;
            ActuatorCommand command;
            if (decoder_.accept(received.frame, clock_time_ns(), command) != DecodeStatus::complete) continue;
            if (auto taken = take(command); !taken) return taken;
        }
        return Ok{};
    }

    Status take(const ActuatorCommand& command) {
        if (over_) return Ok{};
        const std::int64_t now_ns = options_.lockstep ? clock_time_ns() : clock_.now_ns();
        if (!is_expected(command.t_ns, now_ns)) {
            ++counts_.refused;
        } else if (now_ns - command.t_ns > scenario_.period_ns()) {
            ++counts_.late;
        } else {
            commanded_ns_ = command.t_ns;
            if (options_.lockstep) return apply(command), Ok{};
            const std::int64_t acts_ns = std::max(now_ns, command.t_ns) - t_start_ns_;
            if (auto moved = advance_to(std::min(acts_ns, next_ns_)); !moved) return moved;
            if (acts_ns <= next_ns_) return apply(command), Ok{};
            pending_.push_back(command);
        }
        return Ok{};
    }
    void apply(const ActuatorCommand& command) { ++(simulation_.apply(command) ? counts_.applied : counts_.lost); }

    /// In lockstep: exactly the current time, once. In real time: newer than the last, and at most a period ahead.
    bool is_expected(std::int64_t t_ns, std::int64_t now_ns) const {
        if (commanded_ns_ && t_ns <= *commanded_ns_) return false;
        if (options_.lockstep) return t_ns == now_ns;
        return t_ns >= t_start_ns_ && t_ns <= now_ns + scenario_.period_ns();
    }

    /// In lockstep this ends the run even if the bus comes back, as messages are missing.
    bool connection_lost() const { return bus_.counters().interface_down > 0; }

    // --- Motion and its messages ---
    std::int64_t next_pose_ns() const {
        return (simulation_.t_ns() / scenario_.pose_period_ns() + 1) * scenario_.pose_period_ns();
    }

    /// Applies the pending commands that fall due on the way.
    Status advance_to(std::int64_t t_ns) {
        while (!pending_.empty() && pending_.front().t_ns - t_start_ns_ <= t_ns) {
            const ActuatorCommand command = pending_.front();
            pending_.pop_front();
            if (auto moved = move_to(command.t_ns - t_start_ns_); !moved) return moved;
            apply(command);
        }
        return move_to(t_ns);
    }

    /// Reports a contact on the way at its own time.
    Status move_to(std::int64_t t_ns) {
        while (simulation_.t_ns() < t_ns) {
            const DynamicsPhase before = simulation_.phase();
            simulation_.advance_to(t_ns);
            if (simulation_.phase() == before) continue;
            if (auto sent = send_report(simulation_.phase()); !sent) return sent;
            if (auto sent = send_poses(); !sent) return sent;
        }
        return Ok{};
    }

    Status send_period() {
        over_ = simulation_.ending() != Ending::not_yet;
        if (auto sent = send_report(over_ ? DynamicsPhase::finished : simulation_.phase()); !sent) return sent;
        AttitudeReport attitude = simulation_.measure_attitude();
        attitude.t_ns = clock_time_ns();
        attitude.counter = attitude_counter_++;
        if (auto sent = send(encode(attitude, fd_)); !sent) return sent;
        return send_poses();
    }

    Status send_report(DynamicsPhase phase) {
        return send(encode(DynamicsReport{report_counter_++, clock_time_ns(), t_start_ns_, phase}, fd_));
    }

    /// The chaser is sent last: its command lets the emulator advance to this time.
    Status send_poses() {
        const Truth truth = simulation_.truth();
        if (attractor_)
            if (auto sent = send_pose(*attractor_, truth.attractor); !sent) return sent;
        if (auto sent = send_pose(target_, truth.target); !sent) return sent;
        if (auto sent = send_pose(chaser_, truth.chaser); !sent) return sent;
        if (log_) log_->append(simulation_);
        return Ok{};
    }

    Status send_pose(CommandedBody& body, const Motion& motion) {
        const PoseCommand command{body.counter++, clock_time_ns(), motion};
        FrameSet frames;
        if (const EncodeStatus encoded = encode(command, body.base_id, fd_, frames); !encoded)
            return failed(fmt::format("pose of \"{}\" at {:.3f} s: {}", body.name, now_s(), encoded.text()));
        ++poses_;
        return send(frames);
    }

    /// In real time a frame that the bus does not accept is dropped and counted; in lockstep sending is retried.
    Status send(const FrameSet& frames) {
        const std::int64_t deadline_ns = monotonic_ns() + std::llround(options_.patience_s * 1e9);
        for (const CanFrame& frame : frames)
            while (!bus_.send(frame) && options_.lockstep && !stop_) {
                if (monotonic_ns() > deadline_ns)
                    return failed(fmt::format("the bus takes no frame for {} s", options_.patience_s));
                bus_.wait(kShortWaitNs);
                if (auto received = receive(); !received) return received;
                if (connection_lost()) return failed(fmt::format("at {:.3f} s: {}", now_s(), kConnectionLost));
            }
        return Ok{};
    }

    std::int64_t clock_time_ns() const { return t_start_ns_ + simulation_.t_ns(); }
    double now_s() const { return static_cast<double>(simulation_.t_ns()) * 1e-9; }
    Error failed(std::string what) const { return {std::move(what), scenario_.file, 0, 0, ErrorKind::failed}; }

    const Scenario& scenario_;
    const DynamicsOptions& options_;
    Simulation simulation_;
    std::optional<TruthLog> log_;
    CanBus& bus_;
    const StopFlag& stop_;
    bool fd_;
    CommandedBody target_, chaser_;
    std::optional<CommandedBody> attractor_;

    RemoteClock clock_;
    MessageDecoder<ActuatorCommand> decoder_;
    std::int64_t t_start_ns_ = 0;
    std::int64_t next_ns_ = 0;                  // real time: of the next poses
    std::optional<std::int64_t> commanded_ns_;  // of the newest command
    std::deque<ActuatorCommand> pending_;       // real time: commands not due yet, in order of time
    std::uint8_t report_counter_ = 0, attitude_counter_ = 0;
    std::uint64_t poses_ = 0;
    CommandCounts counts_;
    bool over_ = false;
};

nlohmann::json Node::report() const {
    nlohmann::json document = summary(simulation_, scenario_, options_.seed);
    document["lockstep"] = options_.lockstep;
    document["stopped"] = !over_;
    document["t_start_ns"] = t_start_ns_;
    document["pose_commands"] = poses_;
    std::uint64_t bad = 0;
    for (const DecodeStatus s :
         {DecodeStatus::too_short, DecodeStatus::too_long, DecodeStatus::wrong_kind, DecodeStatus::bad_checksum,
          DecodeStatus::incomplete_set, DecodeStatus::not_a_number, DecodeStatus::not_unit})
        bad += decoder_.count(s);
    document["actuator_commands"] = {{"applied", counts_.applied},
                                     {"lost", counts_.lost},
                                     {"late", counts_.late},
                                     {"refused", counts_.refused},
                                     {"bad_frames", bad}};
    document["bus"] = {{"frames_sent", bus_.counters().sent}, {"frames_dropped", bus_.counters().send_drops}};
    return document;
}

}  // namespace

Result<nlohmann::json> run_dynamics(const Scenario& scenario, const DynamicsOptions& options, CanBus& bus,
                                    const StopFlag& stop) {
    std::shared_ptr<const Terrain> terrain;
    if (scenario.gear) {
        auto made = Terrain::create(scenario);
        if (!made) return made.error();
        terrain = *std::move(made);
        const auto site = terrain->below({});
        if (!site || std::abs(site->height_m) > kSiteOff_m)
            return Error{site ? fmt::format("the port of [target], the landing site, is {:.2f} m off the ground, "
                                            "expected {:g} m at most",
                                            -site->height_m, kSiteOff_m)
                              : "there is no ground at the port of [target], the landing site",
                         scenario.file};
    }
    std::optional<TruthLog> log;
    if (!options.log_folder.empty()) {
        auto made = TruthLog::create(options.log_folder);
        if (!made) return made.error();
        log.emplace(std::move(*made));
    }
    Node node(scenario, options, std::move(terrain), std::move(log), bus, stop);
    const Status flown = node.run();
    if (!flown) return flown.error();
    nlohmann::json document = node.report();
    document["version"] = options.version;
    if (!options.log_folder.empty())
        if (Status written = write_file(options.log_folder + "/dynamics.json", document.dump(2) + '\n'); !written)
            return written.error();
    return document;
}

namespace {

std::string ending_text(const std::string& ending) {
    constexpr std::array<std::string_view, kEndings.size()> kWords{"not over",
                                                                   "docked",
                                                                   "bounced off",
                                                                   "the scenario's time is over",
                                                                   "navigation is done",
                                                                   "the chaser has flown off",
                                                                   "landed",
                                                                   "crashed"};
    const auto at = std::find(kEndings.begin(), kEndings.end(), ending);
    return at == kEndings.end() ? ending : std::string(kWords[static_cast<std::size_t>(at - kEndings.begin())]);
}

}  // namespace

std::string to_text(const nlohmann::json& d) {
    const nlohmann::json &commands = d["actuator_commands"], &bus = d["bus"];
    return fmt::format(
        "{}: seed {}, {:.3f} s, {}; {} actuator commands applied, {} lost, {} late, {} refused, {} bad frames; {} "
        "CAN "
        "frames dropped",
        d["scenario"].get<std::string>(), d["seed"].dump(), d["end_s"].get<double>(),
        d["stopped"].get<bool>() ? "stopped" : ending_text(d["ending"].get<std::string>()),
        commands["applied"].dump(), commands["lost"].dump(), commands["late"].dump(), commands["refused"].dump(),
        commands["bad_frames"].dump(), bus["frames_dropped"].dump());
}

}  // namespace narpa::rehearsal
