// narpa fly - plays a trajectory as pose commands on a bus, in step with the emulator's clock or in lockstep.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "apps/cli.h"
#include "apps/outputs.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/remote_clock.h"
#include "emulator/clock.h"
#include "protocols/can/messages.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa::cli {
namespace {

struct FlyOptions {
    std::string trajectory, bus;
    std::vector<std::string> ids;
    std::optional<double> start_s;
    double lead_s = 0.05, wait_s = 15;
    bool lockstep = false, classic = false;
};

constexpr std::int64_t kMs = 1'000'000;
/// Heartbeats come ten times a second; after this long without one the emulator may be gone.
constexpr std::int64_t kDoubtfulSilence_ns = 1000 * kMs;

/// One body's commands on the wire.
struct Commander {
    std::optional<std::uint32_t> base_id{};
    std::uint8_t counter = 0;
    std::int64_t newest_ns = std::numeric_limits<std::int64_t>::min();
};

Result<std::map<std::string, Commander>> commanders(const FlyOptions& o, const std::vector<TrajectoryRow>& rows) {
    std::map<std::string, Commander> all;
    for (const TrajectoryRow& r : rows) all.try_emplace(r.body);
    if (o.ids.empty()) {
        if (all.size() > 1)
            return Error{fmt::format("{} bodies, expected --id BODY=ID for each", all.size()), o.trajectory};
        all.begin()->second.base_id = kDefaultBodyBaseId;
        return all;
    }
    for (const std::string& text : o.ids) {
        auto pair = split_pair(text, "BODY=ID, like chaser=0x100");
        if (!pair) return pair.error();
        const auto at = all.find(pair->first);
        if (at == all.end())
            return Error{fmt::format("--id {}: no such body in the trajectory", text), o.trajectory};
        char* end = nullptr;
        const long id = std::strtol(pair->second.c_str(), &end, 0);
        if (*end != 0) return Error{fmt::format("--id {}, expected BODY=ID, like chaser=0x100", text)};
        if (auto good = check_body_base_id(id); !good)
            return Error{fmt::format("--id {}: {}", text, good.error().what)};
        const auto base_id = static_cast<std::uint32_t>(id);
        if (at->second.base_id) return Error{fmt::format("--id {}: the body has an identifier already", text)};
        for (const auto& [name, c] : all)
            if (c.base_id == base_id)
                return Error{fmt::format("--id {}: that is the identifier of body \"{}\"", text, name)};
        at->second.base_id = base_id;
    }
    for (const auto& [name, c] : all)
        if (!c.base_id)
            return Error{fmt::format("body \"{}\" has no identifier, expected --id {}=ID", name, name),
                         o.trajectory};
    return all;
}

class Player {
public:
    Player(const FlyOptions& o, CanBus& bus, std::map<std::string, Commander>& bodies)
        : options_(o), bus_(bus), bodies_(bodies), fd_(bus.carries_fd() && !o.classic) {}

    Status play(const std::vector<TrajectoryRow>& rows) {
        Progress progress("playing " + options_.trajectory);
        progress.show(fmt::format("waiting at most {:g} s for the emulator's clock", options_.wait_s));
        if (auto ready = synchronise(); !ready) return ready;
        if (auto soon = check_begin(rows); !soon) return soon;
        std::size_t k = 0;
        for (const TrajectoryRow& row : rows) {
            if (stop_flag() || emulator_stops()) break;
            progress.show(static_cast<double>(k) / static_cast<double>(rows.size()),
                          fmt::format("row {} of {}", k + 1, rows.size()));
            ++k;
            const std::int64_t t = row.t_ns + start_ns_;
            if (!options_.lockstep)
                if (auto waited = wait_for(t - std::llround(options_.lead_s * 1e9)); !waited) return waited;
            if (auto fits = check_run(); !fits) return fits;
            if (emulator_stops()) break;
            if (auto sent = send(row, t); !sent) return sent;
            ++rows_sent;
            if (options_.lockstep)
                if (auto reached = wait_in_lockstep(); !reached) return reached;
        }
        return arrived();
    }

    /// The emulator's run has ended, before the trajectory has.
    [[nodiscard]] bool emulator_stops() const { return clock_.stopping(); }
    std::uint64_t commands = 0, frames_dropped = 0;
    std::size_t rows_sent = 0;
    std::int64_t start_ns() const { return start_ns_; }

private:
    /// Real time: the trajectory's time 0 is a round tenth of a second ahead, unless --start is given.
    Status synchronise() {
        const std::int64_t deadline = monotonic_ns() + std::llround(options_.wait_s * 1e9);
        if (!options_.lockstep) {
            while (!bus_.ended() && !clock_.synchronized() && monotonic_ns() < deadline && !stop_flag()) {
                bus_.wait(50 * kMs);
                clock_.listen(bus_);
            }
            if (auto fits = check_run(); !fits) return fits;
            if (!clock_.synchronized()) {
                if (!bus_.ended() && options_.wait_s > 0 && !stop_flag())
                    return Error{
                        fmt::format("no heartbeat in {:g} s: is `narpa run` there? If it runs in lockstep, "
                                    "expected --lockstep here too. --wait 0 plays without heartbeats",
                                    options_.wait_s),
                        options_.bus, 0, 0, ErrorKind::failed};
                clock_.start_here();
            }
        }
        if (options_.start_s) {
            start_ns_ = std::llround(*options_.start_s * 1e9);
        } else if (!options_.lockstep) {
            start_ns_ = (clock_.now_ns() + 300 * kMs) / (100 * kMs) * (100 * kMs);
        }
        return Ok{};
    }

    /// In real time: refuses a trajectory that would begin days from now, such as one in Unix time.
    Status check_begin(const std::vector<TrajectoryRow>& rows) const {
        constexpr std::int64_t kDay_ns = 86'400'000 * kMs;
        if (options_.lockstep || rows.empty() || rows.front().t_ns + start_ns_ - clock_.now_ns() < kDay_ns)
            return Ok{};
        const double first_s = static_cast<double>(rows.front().t_ns) * 1e-9;
        return Error{
            fmt::format("the first row is at {:.10g} s, {:.6g} s ahead of the emulator's clock, expected "
                        "seconds from the start of its run; --start={:.0f} shifts such a time to 0",
                        first_s, static_cast<double>(rows.front().t_ns + start_ns_ - clock_.now_ns()) * 1e-9,
                        -std::floor(first_s)),
            options_.trajectory, rows.front().line};
    }

    /// Checks that the emulator's run is still the one at the start, and in the mode of this side. An emulator in
    /// lockstep starts with heartbeats in the state `starting`; one in real time does not.
    Status check_run() const {
        if (!clock_.synchronized()) return Ok{};
        if (clock_.restarted())
            return Error{
                "the emulator was started again, and its clock with it: expected `narpa fly` once for each of "
                "its runs",
                options_.bus, 0, 0, ErrorKind::failed};
        const RunState state = clock_.newest().state;
        if (!options_.lockstep && (state == RunState::starting || state == RunState::lockstep))
            return Error{"the emulator runs in lockstep, expected --lockstep here too", options_.bus};
        if (options_.lockstep && state == RunState::running)
            return Error{"the emulator runs in real time, expected no --lockstep", options_.bus};
        return Ok{};
    }

    Status wait_for(std::int64_t t_ns) {
        for (std::int64_t left; (left = t_ns - clock_.now_ns()) > 0 && !stop_flag() && !emulator_stops();) {
            bus_.wait(std::min<std::int64_t>(left, 100 * kMs));
            if (auto there = listen(); !there) return there;
        }
        return Ok{};
    }

    /// In real time: reads heartbeats; an Error without one for kHeartbeatSilence_s.
    Status listen() {
        clock_.listen(bus_);
        if (auto fits = check_run(); !fits) return fits;
        if (emulator_stops() || static_cast<double>(clock_.silence_ns()) <= 1e9 * kHeartbeatSilence_s) return Ok{};
        return failed(fmt::format("no heartbeat of the emulator for {:g} s", kHeartbeatSilence_s));
    }

    /// At the end: checks that the emulator is still there and that no frame was dropped.
    Status arrived() {
        if (stop_flag() || bus_.ended()) return Ok{};
        while (!options_.lockstep && !emulator_stops() && clock_.silence_ns() > kDoubtfulSilence_ns) {
            bus_.wait(100 * kMs);
            if (auto there = listen(); !there) return there;
            if (stop_flag()) return Ok{};
        }
        if (frames_dropped == 0 || emulator_stops()) return Ok{};
        return failed(fmt::format("{} frames of the commands could not be sent", frames_dropped));
    }

    Error failed(const std::string& what) const {
        return {fmt::format("{} ({} commands sent, {} frames dropped)", what, commands, frames_dropped),
                options_.bus, 0, 0, ErrorKind::failed};
    }

    Status send(const TrajectoryRow& row, std::int64_t t_ns) {
        Commander& c = bodies_.at(row.body);
        const PoseCommand command{c.counter++, t_ns, row.motion};
        FrameSet frames;
        if (const EncodeStatus encoded = encode(command, *c.base_id, fd_, frames); !encoded)
            return Error{fmt::format("row at {} s of \"{}\": {}", static_cast<double>(row.t_ns) * 1e-9, row.body,
                                     encoded.text()),
                         options_.trajectory};
        for (const CanFrame& f : frames) frames_dropped += !bus_.send(f);
        c.newest_ns = t_ns;
        ++commands;
        return Ok{};
    }

    /// Waits until the emulator's clock has reached the newest time for which all bodies have commands.
    Status wait_in_lockstep() {
        std::int64_t granted = std::numeric_limits<std::int64_t>::max();
        for (const auto& [name, c] : bodies_) granted = std::min(granted, c.newest_ns);
        if (granted <= last_granted_) return Ok{};
        last_granted_ = granted;
        const std::int64_t deadline = monotonic_ns() + std::llround(options_.wait_s * 1e9);
        while (!clock_.reached(granted)) {
            clock_.listen(bus_);
            if (auto fits = check_run(); !fits) return fits;
            if (clock_.reached(granted)) break;
            if (stop_flag() || emulator_stops()) return Ok{};
            if (bus_.counters().interface_down > 0) return failed("the connection to the emulator was lost");
            if (monotonic_ns() > deadline)
                return Error{
                    fmt::format(
                        "no heartbeat of {:.6f} s in {} s: is `narpa run --lockstep` running, and are all of "
                        "its scene's commanded bodies in the trajectory?",
                        static_cast<double>(granted) * 1e-9, options_.wait_s),
                    options_.bus, 0, 0, ErrorKind::failed};
            bus_.wait(20 * kMs);
        }
        return Ok{};
    }

    const FlyOptions& options_;
    CanBus& bus_;
    std::map<std::string, Commander>& bodies_;
    bool fd_;
    RemoteClock clock_;
    std::int64_t start_ns_ = 0, last_granted_ = std::numeric_limits<std::int64_t>::min();
};

/// Refuses a log that would overwrite the trajectory. Logs are the only buses that are files.
Status check_log(const FlyOptions& o) {
    constexpr std::string_view kLog = "log:";
    if (!o.bus.starts_with(kLog)) return Ok{};
    return keep_inputs({o.bus.substr(kLog.size())}, {o.trajectory});
}

Outcome fly(const FlyOptions& o) {
    if (auto good = check_log(o); !good) return good.error();
    auto rows = read_trajectory(own_or_shipped(o.trajectory));
    if (!rows) return rows.error();
    auto bodies = commanders(o, *rows);
    if (!bodies) return bodies.error();
    std::stable_sort(rows->begin(), rows->end(), [](const auto& a, const auto& b) { return a.t_ns < b.t_ns; });

    stop_on_signals();
    auto bus = [&] {
        Progress progress("joining " + o.bus);
        progress.show(
            fmt::format("nobody is there yet; waiting at most {:g} s for `narpa run` (--wait)", o.wait_s));
        return join_can_bus(o.bus, o.wait_s, stop_flag());
    }();
    if (!bus) return bus.error();
    say(fmt::format("{}: {} rows, {} {}, on {}", o.trajectory, rows->size(), bodies->size(),
                    bodies->size() == 1 ? "body" : "bodies", (*bus)->description()));
    Player player(o, **bus, *bodies);
    if (auto played = player.play(*rows); !played) return played.error();

    if (player.emulator_stops() && player.rows_sent < rows->size())
        say(fmt::format("the emulator stopped: {} of {} rows were sent", player.rows_sent, rows->size()));
    const CanCounters& c = (*bus)->counters();
    say(fmt::format("{} commands sent from {:.3f} s on, {} frames dropped, {} frames received", player.commands,
                    static_cast<double>(player.start_ns()) * 1e-9, player.frames_dropped, c.received));
    if ((*bus)->ended() && player.frames_dropped > 0)  // a log
        return Error{fmt::format("{} frames could not be written", player.frames_dropped), o.bus, 0, 0,
                     ErrorKind::failed};
    return nlohmann::json{{"commands", player.commands},   {"start_ns", player.start_ns()},
                          {"frames_sent", c.sent},         {"frames_dropped", player.frames_dropped},
                          {"frames_received", c.received}, {"rows", rows->size()},
                          {"rows_sent", player.rows_sent}, {"stopped", stop_flag().load()}};
}

}  // namespace

Command add_fly(Parser app) {
    auto o = std::make_shared<FlyOptions>();
    const Parser c = app.subcommand("fly", "Play a trajectory as pose commands on a CAN bus");
    c.option("TRAJECTORY", o->trajectory,
             "Poses of bodies over time: CSV with the columns of a run's CAMERA.truth.csv, or TOML that names "
             "orbit and attitude ephemerides (CCSDS OEM, AEM) and tables")
        .required();
    c.option("--can", o->bus, can_bus_help()).type_name("BUS").joined_by('+').required();
    c.option("--id", o->ids,
             "Base identifier of a body's commands, the scene's can_id (default: 0x100, for a file with one body)")
        .type_name("BODY=ID")
        .repeatable();
    c.option("--start", o->start_s,
             "Simulation time of the trajectory's time 0 (default: about 0.3 s ahead; 0 in lockstep)")
        .type_name("SECONDS")
        .range(-9e9, 9e9);
    c.option("--lead", o->lead_s, "Seconds by which a command is sent before its time of validity")
        .type_name("SECONDS")
        .range(0.0, 1.0)
        .shows_default();
    c.option("--wait", o->wait_s, "Seconds to wait for the bus and for heartbeats; 0 plays without heartbeats")
        .type_name("SECONDS")
        .range(0.0, 3600.0)
        .shows_default();
    c.flag("--lockstep", o->lockstep,
           "Send the next command when the emulator's clock has reached the previous one");
    c.flag("--classic", o->classic, "Nine classic frames per command even if the bus carries CAN FD");
    c.group("Sensors");
    c.examples({"narpa fly approach.csv --can vcan0", "narpa fly approach.csv --can slcan:29537 --lockstep"});
    return [o] { return fly(*o); };
}

}  // namespace narpa::cli
