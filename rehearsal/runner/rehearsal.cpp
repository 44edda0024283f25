#include "rehearsal/runner/rehearsal.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <thread>

#include "drivers/can/remote_clock.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/free_port.h"
#include "rehearsal/runner/report_charts.h"
#include "rehearsal/runner/report_page.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr double kStartPatience_s = 120, kOwnNavigationPatience_s = 10, kEndPatience_s = 20;
constexpr std::int64_t kBusWaitNs = 20'000'000;

double seconds_since(Clock::time_point t) {
    return std::chrono::duration<double>(Clock::now() - t).count();
}

std::string time_of_day() {
    const std::time_t now = std::time(nullptr);
    std::tm utc{};
    ::gmtime_r(&now, &utc);
    std::array<char, 32> text{};
    return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc)};
}

class Rehearsal {
public:
    Rehearsal(const RehearsalOptions& o, const Console& console, const StopFlag& stop, Scenario scenario)
        : o_(o), console_(console), stop_(stop), s_(std::move(scenario)), judge_(s_, [this](const GateResult& g) {
              console_.say(fmt::format("gate {}: {}", g.name, g.reason));
          }) {}

    ~Rehearsal() {
        for (const std::string& fifo : fifos_) ::unlink(fifo.c_str());
    }

    Result<RehearsalResult> run() {
        if (Status good = prepare(); !good) return good.error();
        if (Status good = start_emulator(); !good) return good.error();
        if (Status good = join(); !good) return good.error();
        if (Status good = start_navigation(); !good) return good.error();
        if (Status good = start_dynamics(); !good) return good.error();
        if (Status good = record(); !good) return good.error();
        listen();
        end_all();
        return conclude();
    }

private:
    struct Program {
        ChildProcess::Command command;
        std::optional<ChildProcess> child;
        bool ours = true;

        /// Its last words, where it ended badly.
        [[nodiscard]] std::string trouble() {
            const auto status = child ? child->status() : std::nullopt;
            if (!status || *status == 0) return "";
            const std::string words = last_line(command.err);
            return fmt::format(
                "{} ended with {}{}", command.name,
                *status > 128 ? fmt::format("signal {}", *status - 128) : fmt::format("status {}", *status),
                words.empty() ? "" : ": " + words);
        }
        [[nodiscard]] bool over() { return child && child->status(); }
    };

    [[nodiscard]] std::string in(const std::string& name) const { return o_.folder + "/" + name; }
    [[nodiscard]] std::uint64_t seed() const { return o_.seed.value_or(s_.seed); }
    [[nodiscard]] std::string program(const std::string& name) const {
        return (o_.programs.empty() ? program_folder() : o_.programs) + "/" + name;
    }

    Status prepare() {
        if (Status good = claim_folder(o_.folder, "rehearsal.json"); !good) return good;
        std::error_code failed;
        for (const char* name : {"emulator", "dynamics", "navigation"}) {
            fs::remove_all(in(name), failed);
            fs::create_directories(in(name), failed);
        }
        for (const char* name :
             {"emulator.log", "dynamics.log", "navigation.log", "result.json", "junit.xml", "index.html"})
            fs::remove(in(name), failed);
        // From here on the folder is a rehearsal's, whatever becomes of it.
        if (Status good = write_text(in("rehearsal.json"), "{}\n"); !good) return good;
        const auto texts = scenario_texts(s_.file, s_.scene);
        if (!texts) return texts.error();
        hash_ = texts->hash;
        if (Status good = write_text(in("scenario.toml"), texts->scenario); !good) return good;
        if (Status good = write_text(in("scene.toml"), texts->scene); !good) return good;
        for (const std::string& camera : s_.navigation.cameras) {
            if (const auto own = o_.video.find(camera); own != o_.video.end()) {
                video_.emplace_back(camera, own->second);
                continue;
            }
            const std::string fifo = in(camera + ".fifo");
            ::unlink(fifo.c_str());
            if (::mkfifo(fifo.c_str(), 0600) != 0)
                return Error{fmt::format("cannot make a FIFO: {}", std::strerror(errno)), fifo, 0, 0,
                             ErrorKind::failed};
            fifos_.push_back(fifo);
            video_.emplace_back(camera, fifo);
        }
        for (const auto& [camera, device] : o_.video)
            if (std::find(s_.navigation.cameras.begin(), s_.navigation.cameras.end(), camera) ==
                s_.navigation.cameras.end())
                return Error{fmt::format("--video {}={}: the chaser does not navigate by this camera, expected {}",
                                         camera, device, fmt::join(s_.navigation.cameras, " or ")),
                             s_.file};
        for (const std::string& lidar : s_.navigation.lidars) {
            auto port = free_lidar_port();
            if (!port) return port.error();
            lidar_.emplace_back(lidar, *port);
        }
        return Ok{};
    }

    Status start(Program& p, const char* name) {
        p.command.name = std::string("the ") + name;
        p.command.out = p.command.err = in(std::string(name) + ".log");
        auto child = ChildProcess::start(p.command);
        if (!child) return child.error();
        p.child = std::move(*child);
        return Ok{};
    }

    // --- The emulator ---

    Status start_emulator() {
        auto& line = emulator_.command.line;
        line = {program("narpa"), "run", s_.scene, "--can", o_.bus, "--log", in("emulator")};
        for (const auto& [camera, sink] : video_) line.insert(line.end(), {"--video", camera + "=" + sink});
        for (const auto& [lidar, port] : lidar_)
            line.insert(line.end(), {"--lidar", fmt::format("{}=udp:127.0.0.1:{}", lidar, port)});
        if (!o_.real_time) line.emplace_back("--lockstep");
        if (o_.threads > 0) line.insert(line.end(), {"--threads", std::to_string(o_.threads)});
        console_.say("emulator: " + ChildProcess::shell_line(emulator_.command));
        return start(emulator_, "emulator");
    }

    /// Its bus is there once it says so; a port of its own choice stands in the same line.
    Status join() {
        const auto said = [&](const char* what) { return read_text(emulator_.command.err).find(what); };
        const auto began = Clock::now();
        while (said("commands: ") == std::string::npos) {
            if (stop_) return interrupted();
            if (emulator_.over()) {
                const int status = *emulator_.child->status();
                return Error{emulator_.trouble(), emulator_.command.err, 0, 0,
                             status == 2   ? ErrorKind::bad_input
                             : status == 3 ? ErrorKind::missing
                                           : ErrorKind::failed};
            }
            if (seconds_since(began) > kStartPatience_s)
                return Error{fmt::format("the emulator opened no bus within {:g} s", kStartPatience_s),
                             emulator_.command.err, 0, 0, ErrorKind::failed};
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        bus_name_ = o_.bus;
        if (o_.bus.starts_with("slcan:")) {
            const std::string text = read_text(emulator_.command.err), before = "commands: slcan: 127.0.0.1:";
            const std::size_t at = text.find(before);
            bus_name_ = "slcan:" +
                        std::to_string(at == std::string::npos ? 0 : std::atoi(text.c_str() + at + before.size()));
        }
        auto bus = join_can_bus(bus_name_, 10, stop_);
        if (!bus) return bus.error();
        bus_ = std::move(*bus);
        return Ok{};
    }

    // --- Navigation and dynamics, ours or the user's ---

    [[nodiscard]] std::vector<std::pair<std::string, std::string>> environment() const {
        std::string video, lidar;
        for (const auto& [camera, source] : video_) video += (video.empty() ? "" : " ") + camera + "=" + source;
        for (const auto& [name, port] : lidar_)
            lidar += (lidar.empty() ? "" : " ") + fmt::format("{}=udp:{}", name, port);
        return {{"SCENARIO", s_.file},
                {"BUS", bus_name_},
                {"VIDEO", video},
                {"LIDAR", lidar},
                {"SEED", std::to_string(seed())},
                {"LOCKSTEP", o_.real_time ? "" : "1"},
                {"LOG", o_.folder}};
    }

    Status start_replaceable(Program& p, const char* name, const std::string& replaced,
                             const std::vector<std::string>& sources) {
        p.ours = replaced.empty();
        if (replaced == "none") {
            std::string words = fmt::format("start your own {} now{}:", name,
                                            &p == &navigation_ ? ", and press Enter when it listens" : "");
            for (const auto& [key, value] : environment()) words += fmt::format("\n  {}={}", key, value);
            console_.say(words);
            p.command.line = {"none"};
            return Ok{};
        }
        if (p.ours) {
            p.command.line = {program(std::string("narpa-") + name), s_.file, "--can", bus_name_};
            p.command.line.insert(p.command.line.end(), sources.begin(), sources.end());
            if (!o_.real_time) p.command.line.emplace_back("--lockstep");
            p.command.line.insert(p.command.line.end(), {"--seed", std::to_string(seed()), "--log", in(name)});
        } else {
            p.command.line = {"/bin/sh", "-c", replaced};
            p.command.environment = environment();
        }
        console_.say(fmt::format("{}: {}", name, ChildProcess::shell_line(p.command)));
        return start(p, name);
    }

    /// Goes on when it has said "ready"; another's own need not. What the user starts listens when the user says
    /// so.
    Status start_navigation() {
        std::vector<std::string> sources;
        for (const auto& [camera, source] : video_)
            sources.insert(sources.end(), {"--video", camera + "=" + source});
        for (const auto& [lidar, port] : lidar_)
            sources.insert(sources.end(), {"--lidar", fmt::format("{}=udp:{}", lidar, port)});
        if (o_.threads > 0) sources.insert(sources.end(), {"--threads", std::to_string(o_.threads)});
        if (Status good = start_replaceable(navigation_, "navigation", o_.navigation, sources); !good) return good;
        const auto began = Clock::now();
        const auto listens = [&] {
            if (!navigation_.child && console_.navigation_ready) return console_.navigation_ready();
            if (!navigation_.child) return seconds_since(began) > kOwnNavigationPatience_s;
            return ("\n" + read_text(navigation_.command.out)).find("\nready") != std::string::npos;
        };
        while (!listens()) {
            pump();
            if (stop_) return interrupted();
            if (!navigation_.child) continue;
            if (navigation_.over())
                return Error{fmt::format("{} before it was ready", navigation_.trouble()), navigation_.command.err,
                             0, 0, exit_kind(*navigation_.child->status())};
            if (!navigation_.ours && seconds_since(began) > kOwnNavigationPatience_s) break;
            if (seconds_since(began) > kStartPatience_s)
                return Error{fmt::format("the navigation did not say \"ready\" within {:g} s", kStartPatience_s),
                             navigation_.command.err, 0, 0, ErrorKind::failed};
        }
        return Ok{};
    }

    Status start_dynamics() { return start_replaceable(dynamics_, "dynamics", o_.dynamics, {}); }

    static ErrorKind exit_kind(int status) {
        return status == 2 ? ErrorKind::bad_input : status == 3 ? ErrorKind::missing : ErrorKind::failed;
    }
    static Error interrupted() { return {"interrupted", "", 0, 0, ErrorKind::failed}; }

    // --- While it runs ---

    void pump() {
        bus_->wait(kBusWaitNs);
        for (ReceivedFrame received; bus_->receive(received);)
            judge_.accept(received.frame, std::max<std::int64_t>(judge_.bus().t_heartbeat_ns, 0));
    }

    /// Until the dynamics have said that it is over, somebody ended, or nothing moved for too long.
    void listen() {
        auto moved = Clock::now(), told = moved;
        std::int64_t newest = BusRecord::kNever;
        while (!judge_.finished()) {
            pump();
            if (const std::int64_t t = judge_.bus().t_heartbeat_ns; t != newest || judge_.finished()) {
                newest = t;
                moved = Clock::now();
            }
            if (seconds_since(told) > 0.2) told = Clock::now(), tell_progress();
            if (stop_) trouble_ = "interrupted";
            for (Program* p : {&emulator_, &navigation_, &dynamics_})
                if (trouble_.empty() && p->over()) {
                    pump();  // its last words may be under way
                    if (judge_.finished()) break;
                    trouble_ = p->trouble();
                    if (trouble_.empty()) trouble_ = p->command.name + " ended before the run was over";
                }
            if (trouble_.empty() && seconds_since(moved) > o_.patience_s)
                trouble_ = fmt::format("nothing moved for {:g} s", o_.patience_s);
            if (!trouble_.empty() && !judge_.finished()) break;
        }
        console_.progress("");
    }

    void tell_progress() const {
        const BusRecord& bus = judge_.bus();
        if (bus.truth.empty()) return console_.progress("waiting for the first poses");
        std::string text =
            fmt::format("t = {:.1f} s, {:.2f} m", bus.seconds(bus.truth.back().t_ns), bus.truth.back().range_m());
        if (!bus.commands.empty())
            text += fmt::format(", {}, {}", leg_text(s_, bus.commands.back().leg),
                                kGuidancePhases[static_cast<std::size_t>(bus.commands.back().phase)]);
        console_.progress(text + (judge_.failures() == 0 ? ", gates good"
                                                         : fmt::format(", {} gate(s) FAILED", judge_.failures())));
    }

    /// Dynamics and navigation end by themselves; the emulator, which writes its logs then, is asked to.
    void end_all() {
        const auto began = Clock::now();
        const auto wait_for = [&](Program& p) {
            while (trouble_.empty() && p.child && !p.over() && seconds_since(began) < kEndPatience_s) pump();
            if (trouble_.empty() && p.child) trouble_ = p.trouble();
            if (p.child) p.child->end(trouble_.empty() ? 0 : 2);
        };
        wait_for(dynamics_);
        wait_for(navigation_);
        if (emulator_.child) {
            emulator_.child->terminate();
            const auto asked = Clock::now();
            while (!emulator_.over() && seconds_since(asked) < kEndPatience_s) pump();
            if (trouble_.empty()) trouble_ = emulator_.trouble();
            emulator_.child->end(0);
        }
    }

    // --- Afterwards ---

    Status record() {
        record_ = {{"format", 1},
                   {"scenario", fs::absolute(s_.file).lexically_normal().string()},
                   {"scene", fs::absolute(s_.scene).lexically_normal().string()},
                   {"scenario_hash", hash_},
                   {"mode", o_.real_time ? "real time" : "lockstep"},
                   {"seed", seed()},
                   {"bus", bus_name_},
                   {"threads", o_.threads},
                   {"dynamics", o_.dynamics},
                   {"navigation", o_.navigation},
                   {"command_lines",
                    {{"emulator", ChildProcess::shell_line(emulator_.command)},
                     {"navigation", ChildProcess::shell_line(navigation_.command)},
                     {"dynamics", ChildProcess::shell_line(dynamics_.command)}}},
                   {"version", o_.version},
                   {"begun", time_of_day()}};
        return write_text(in("rehearsal.json"), record_.dump(2) + "\n");
    }

    Result<RehearsalResult> conclude() {
        RehearsalResult done;
        done.wall_s = seconds_since(began_);
        done.verdict = judge_.finish(trouble_);
        const Verdict& v = done.verdict;
        done.result = to_json(v);
        done.result["scenario"] = s_.name;
        done.result["scenario_hash"] = hash_;
        done.result["seed"] = seed();
        done.result["version"] = o_.version;
        done.result["trouble"] = trouble_;
        if (o_.page) {
            record_["wall_s"] = done.wall_s;
            done.page = in("index.html");
            if (Status good = draw_charts(o_.folder, rehearsal_plot({s_, judge_.bus(), v})); !good)
                return good.error();
            if (Status good = write_text(done.page, rehearsal_page(s_, judge_.bus(), v, record_, o_.folder)); !good)
                return good.error();
        }
        if (Status good = write_junit(in("junit.xml"), junit(v, s_.name, done.wall_s)); !good) return good.error();
        // Last: who finds it finds all the rest.
        if (Status good = write_text(in("result.json"), done.result.dump(2) + "\n"); !good) return good.error();
        return done;
    }

    const RehearsalOptions& o_;
    const Console& console_;
    const StopFlag& stop_;
    const Scenario s_;
    Judge judge_;
    const Clock::time_point began_ = Clock::now();
    std::string hash_, bus_name_, trouble_;
    std::vector<std::pair<std::string, std::string>> video_;
    std::vector<std::pair<std::string, int>> lidar_;
    std::vector<std::string> fifos_;
    std::unique_ptr<CanBus> bus_;
    json record_;
    Program emulator_, navigation_, dynamics_;
};

}  // namespace

Result<RehearsalResult> run_rehearsal(const RehearsalOptions& options, const Console& console,
                                      const StopFlag& stop) {
    auto scenario = read_scenario(options.scenario);
    if (!scenario) return scenario.error();
    return Rehearsal(options, console, stop, *std::move(scenario)).run();
}

}  // namespace narpa::rehearsal
