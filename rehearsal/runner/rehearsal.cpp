#include "rehearsal/runner/rehearsal.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <filesystem>

#include "base/program_beside.h"
#include "base/write_file.h"
#include "drivers/can/remote_clock.h"
#include "rehearsal/judge/judge.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/free_port.h"
#include "rehearsal/runner/run_folder.h"
#include "rehearsal/runner/run_results.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Clock = std::chrono::steady_clock;
using Ready = ChildProcess::Ready;

constexpr double kStartPatience_s = 120, kCommandPatience_s = 10, kEndPatience_s = 20;
constexpr double kSpeedWindow_s = 5;
constexpr double kStalled_s = 5;  ///< wall time; a clock that stands still for longer is reported
constexpr double kEnding_s = 2;   // typical time to end the programs and to draw charts and page
constexpr std::int64_t kBusWait_ns = 20'000'000;

double seconds_since(Clock::time_point t) {
    return std::chrono::duration<double>(Clock::now() - t).count();
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm utc{};
    ::gmtime_r(&now, &utc);
    std::array<char, 32> text{};
    return {text.data(), std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc)};
}

std::string whole_path(const std::string& path) {
    return fs::absolute(path).lexically_normal().string();
}

/// As soon as it has failed; the reason follows with the verdict.
std::string live_text(const GateResult& gate) {
    return fmt::format("gate {} failed", gate.name) +
           (gate.t_first_s ? fmt::format(" at t = {:.2f} s", *gate.t_first_s) : std::string());
}

class Rehearsal {
public:
    Rehearsal(const RehearsalOptions& options, const Console& console, const StopFlag& stop, Scenario scenario)
        : options_(options), console_(console), stop_(stop), scenario_(std::move(scenario)) {}

    ~Rehearsal() {
        for (const std::string& fifo : fifos_) ::unlink(fifo.c_str());
    }

    Result<RehearsalResult> run() {
        for (const auto step : {&Rehearsal::prepare_folder, &Rehearsal::prepare_sensors, &Rehearsal::start_emulator,
                                &Rehearsal::join_bus, &Rehearsal::start_navigation, &Rehearsal::start_dynamics,
                                &Rehearsal::write_record})
            if (Status done = (this->*step)(); !done) return failed_start(done.error());
        std::error_code failed;
        fs::remove_all(in_folder(kEarlier), failed);
        fly();
        show_ending("ending the programs");
        stop_programs();
        show_ending("drawing charts and page");
        return write_results();
    }

private:
    [[nodiscard]] std::string in_folder(const std::string& name) const { return options_.folder + "/" + name; }
    [[nodiscard]] std::uint64_t seed() const { return options_.seed.value_or(scenario_.seed); }
    [[nodiscard]] std::string program(const std::string& name) const {
        return (options_.programs.empty() ? program_folder().string() : options_.programs) + "/" + name;
    }
    static Error interrupted() { return {"interrupted", "", 0, 0, ErrorKind::failed}; }

    // --- Folder and sensor links ---

    /// Files that a run leaves in its folder.
    static constexpr std::array kFiles{"emulator",       "dynamics",   "navigation",     "emulator.log",
                                       "dynamics.log",   "charts",     "navigation.log", "charts.json",
                                       "result.json",    "junit.xml",  "index.html",     "scenario.toml",
                                       "rehearsal.json", "scene.toml", "map.toml"};
    /// Subfolders: for an earlier run's files until all programs have started, and for a start that failed.
    static constexpr const char *kEarlier = "earlier", *kFailedStart = "failed-start";

    /// Replaces the run in the folder `to` by that in `from`.
    static void move_run(const std::string& from, const std::string& to) {
        std::error_code failed;
        fs::create_directories(to, failed);
        for (const std::string name : kFiles) {
            fs::remove_all(to + "/" + name, failed);
            fs::rename(from + "/" + name, to + "/" + name, failed);
        }
    }

    /// Moves the earlier run back, if there is one.
    void restore_earlier() {
        std::error_code failed;
        if (!fs::exists(in_folder(kEarlier), failed)) return;
        move_run(in_folder(kEarlier), options_.folder);
        fs::remove_all(in_folder(kEarlier), failed);
    }

    Error failed_start(Error error) {
        for (Program* p : {&dynamics_, &navigation_, &emulator_}) p->child.reset();
        std::error_code failed;
        if (!lock_ || !fs::exists(in_folder(kEarlier), failed)) return error;
        move_run(options_.folder, in_folder(kFailedStart));
        restore_earlier();
        if (error.file.starts_with(in_folder("")))
            error.file = in_folder(kFailedStart) + error.file.substr(options_.folder.size());
        return error;
    }

    Status prepare_folder() {
        auto lock = claim_folder(options_.folder, FolderKind::run);
        if (!lock) return lock.error();
        lock_ = *std::move(lock);
        std::error_code failed;
        fs::remove_all(in_folder(kFailedStart), failed);
        restore_earlier();  // after a start that was killed
        if (fs::exists(in_folder("result.json"), failed)) move_run(options_.folder, in_folder(kEarlier));
        for (const char* name : kFiles) fs::remove_all(in_folder(name), failed);
        for (const char* name : {"emulator", "dynamics", "navigation"})
            fs::create_directories(in_folder(name), failed);
        // Marks the folder as a rehearsal's, even if this run gets no further.
        if (Status good = write_file(in_folder("rehearsal.json"), "{}\n"); !good) return good;
        const auto texts = scenario_texts(scenario_);
        if (!texts) return texts.error();
        hash_ = texts->hash;
        if (Status good = write_file(in_folder("scenario.toml"), texts->scenario); !good) return good;
        if (!texts->map.empty())
            if (Status good = write_file(in_folder("map.toml"), texts->map); !good) return good;
        return write_file(in_folder("scene.toml"), texts->scene);
    }

    /// A FIFO for each camera without a device, a free UDP port for each LiDAR.
    Status prepare_sensors() {
        const auto& cameras = scenario_.navigation.cameras;
        for (const auto& [camera, device] : options_.video)
            if (std::find(cameras.begin(), cameras.end(), camera) == cameras.end())
                return Error{fmt::format("--video {}={}: the chaser does not navigate by this camera, expected {}",
                                         camera, device, fmt::join(cameras, " or ")),
                             scenario_.file};
        for (const std::string& camera : cameras) {
            if (const auto device = options_.video.find(camera); device != options_.video.end()) {
                video_.push_back(camera + "=" + device->second);
                continue;
            }
            const std::string fifo = in_folder(camera + ".fifo");
            ::unlink(fifo.c_str());
            if (::mkfifo(fifo.c_str(), 0600) != 0)
                return Error{fmt::format("cannot make a FIFO: {}", std::strerror(errno)), fifo, 0, 0,
                             ErrorKind::failed};
            fifos_.push_back(fifo);
            video_.push_back(camera + "=" + fifo);
        }
        for (const std::string& lidar : scenario_.navigation.lidars) {
            auto port = free_lidar_port();
            if (!port) return port.error();
            lidar_sinks_.push_back(fmt::format("{}=udp:127.0.0.1:{}", lidar, *port));
            lidar_sources_.push_back(fmt::format("{}=udp:{}", lidar, *port));
        }
        for (const std::string& lidar : scenario_.navigation.velocimeters) lidar_sinks_.push_back(lidar + "=can");
        return Ok{};
    }

    static void append(std::vector<std::string>& line, const char* flag, const std::vector<std::string>& values) {
        for (const std::string& value : values) line.insert(line.end(), {flag, value});
    }

    // --- The emulator, which makes the bus ---

    Status start_emulator() {
        auto& line = emulator_.command.line;
        line = {program("narpa"),      "run",    scenario_.scene,       "--can", options_.bus, "--log",
                in_folder("emulator"), "--seed", std::to_string(seed())};
        append(line, "--set", scenario_.scene_overrides);
        append(line, "--video", video_);
        if (options_.keep_frames)
            for (const std::string& camera : scenario_.navigation.cameras)
                append(line, "--video", {camera + "=" + in_folder("emulator/" + camera + ".y4m")});
        append(line, "--lidar", lidar_sinks_);
        if (!options_.mcap.empty()) append(line, "--mcap", {options_.mcap});
        if (!options_.real_time) line.emplace_back("--lockstep");
        if (options_.threads > 0) append(line, "--threads", {std::to_string(options_.threads)});
        emulator_.command.ready = Ready::option;
        console_.print("emulator: " + ChildProcess::shell_line(emulator_.command));
        return emulator_.start("emulator", options_.folder);
    }

    Status join_bus() {
        const auto began = Clock::now();
        std::optional<std::string> addresses;
        while (!(addresses = emulator_.child->ready())) {
            if (stop_) return interrupted();
            if (emulator_.ended()) return emulator_.start_error(emulator_.failure());
            if (seconds_since(began) > kStartPatience_s)
                return emulator_.start_error(
                    fmt::format("the emulator opened no bus within {:g} s", kStartPatience_s));
            emulator_.child->wait_ready(kBusWait_ns);
        }
        bus_name_ = value_of(*addresses, "CAN");
        auto bus = join_can_bus(bus_name_, 10, stop_);
        if (!bus) return bus.error();
        bus_ = std::move(*bus);
        return Ok{};
    }

    // --- Navigation and dynamics: ours, a command of the user's, or started by the user ---

    [[nodiscard]] std::vector<std::pair<std::string, std::string>> environment() const {
        return {{"SCENARIO", scenario_.file},
                {"BUS", bus_name_},
                {"VIDEO", fmt::format("{}", fmt::join(video_, " "))},
                {"LIDAR", fmt::format("{}", fmt::join(lidar_sources_, " "))},
                {"SEED", std::to_string(seed())},
                {"LOCKSTEP", options_.real_time ? "" : "1"},
                {"SET", fmt::format("{}", fmt::join(scenario_.overrides, "\n"))},
                {"LOG", options_.folder}};
    }

    Status start_replaceable(Program& p, const std::string& name, const std::string& replacement,
                             const std::vector<std::string>& arguments) {
        if (replacement == "none") {
            std::string text = fmt::format("start your own {} now{}:", name,
                                           &p == &navigation_ ? ", and press Enter when it listens" : "");
            for (const auto& [key, value] : environment()) text += fmt::format("\n  {}={}", key, value);
            console_.print(text);
            p.command.line = {"none"};
            return Ok{};
        }
        auto& line = p.command.line;
        if (replacement.empty()) {
            line = {program("narpa-" + name), scenario_.file, "--can", bus_name_};
            append(line, "--set", scenario_.overrides);
            line.insert(line.end(), arguments.begin(), arguments.end());
            if (!options_.real_time) line.emplace_back("--lockstep");
            line.insert(line.end(), {"--seed", std::to_string(seed()), "--log", in_folder(name)});
            p.command.ready = Ready::option;
        } else {
            line = {"/bin/sh", "-c", replacement};
            p.command.environment = environment();
            p.command.ready = Ready::variable;
        }
        console_.print(fmt::format("{}: {}", name, ChildProcess::shell_line(p.command)));
        return p.start(name, options_.folder);
    }

    /// Returns once the navigation is ready: the dynamics, which send the first poses, are started after it.
    Status start_navigation() {
        std::vector<std::string> arguments;
        append(arguments, "--video", video_);
        append(arguments, "--lidar", lidar_sources_);
        if (options_.threads > 0) append(arguments, "--threads", {std::to_string(options_.threads)});
        if (Status good = start_replaceable(navigation_, "navigation", options_.navigation, arguments); !good)
            return good;
        const bool command = navigation_.command.ready == Ready::variable;
        const auto began = Clock::now();
        for (;;) {
            const Result<bool> ready = navigation_is_ready(seconds_since(began));
            if (!ready) return ready.error();
            if (*ready) break;
            receive();
            if (stop_) return interrupted();
            if (!navigation_.child) continue;
            if (navigation_.ended())
                return navigation_.start_error(fmt::format("{} before it was ready", navigation_.failure()));
            if (command && seconds_since(began) > kCommandPatience_s) break;
            if (seconds_since(began) > kStartPatience_s)
                return navigation_.start_error(
                    fmt::format("the navigation was not ready within {:g} s", kStartPatience_s));
        }
        return Ok{};
    }

    /// A user's command may print the line "ready" instead of writing to READY_FD.
    Result<bool> navigation_is_ready(double waited_s) {
        if (!navigation_.child && console_.navigation_ready) return console_.navigation_ready();
        if (!navigation_.child) return waited_s > kCommandPatience_s;
        if (navigation_.child->ready()) return true;
        return navigation_.command.ready == Ready::variable &&
               ("\n" + read_text(navigation_.command.out)).find("\nready") != std::string::npos;
    }

    Status start_dynamics() { return start_replaceable(dynamics_, "dynamics", options_.dynamics, {}); }

    Status write_record() {
        record_ = {{"format", 1},
                   {"scenario", whole_path(scenario_.file)},
                   {"scene", whole_path(scenario_.scene)},
                   {"map", scenario_.navigation.scene.empty() ? "" : whole_path(scenario_.navigation.scene)},
                   {"set", scenario_.overrides},
                   {"scenario_hash", hash_},
                   {"mode", options_.real_time ? "real time" : "lockstep"},
                   {"seed", seed()},
                   {"bus", bus_name_},
                   {"threads", options_.threads},
                   {"dynamics", options_.dynamics},
                   {"navigation", options_.navigation},
                   {"command_lines",
                    {{"emulator", ChildProcess::shell_line(emulator_.command)},
                     {"navigation", ChildProcess::shell_line(navigation_.command)},
                     {"dynamics", ChildProcess::shell_line(dynamics_.command)}}},
                   {"version", options_.version},
                   {"begun", utc_now()}};
        return write_file(in_folder("rehearsal.json"), record_.dump(2) + "\n");
    }

    // --- While it runs ---

    void receive() {
        bus_->wait(kBusWait_ns);
        ReceivedFrame received;
        for (int i = 0; i < kFramesPerTurn && bus_->receive(received); ++i)
            judge_.accept(received.frame, std::max<std::int64_t>(judge_.bus().t_heartbeat_ns, 0));
    }

    /// Runs until the dynamics report the end, a program ends, or the clock stands still for too long.
    void fly() {
        auto advanced = Clock::now(), shown = advanced;
        std::int64_t newest = BusRecord::kNever;
        while (!judge_.finished() && trouble_.empty()) {
            receive();
            if (const std::int64_t t = judge_.bus().t_heartbeat_ns; t != newest)
                newest = t, advanced = Clock::now();
            if (seconds_since(shown) > 0.2) shown = Clock::now(), show_progress(seconds_since(advanced));
            if (!judge_.finished()) trouble_ = find_trouble(seconds_since(advanced));
        }
    }

    std::string find_trouble(double stalled_s) {
        if (stop_) return "interrupted";
        for (Program* p : {&emulator_, &navigation_, &dynamics_}) {
            if (!p->ended()) continue;
            receive();  // its last messages
            if (judge_.finished()) return "";
            const std::string failure = p->failure();
            return failure.empty() ? p->command.name + " ended before the run was over" : failure;
        }
        return stalled_s > options_.patience_s ? fmt::format("nothing moved for {:g} s", options_.patience_s) : "";
    }

    void show_progress(double stalled_s) {
        const BusRecord& bus = judge_.bus();
        if (bus.truth.empty()) return console_.progress(-1, -1, "waiting for the first poses");
        const double t_s = bus.seconds(bus.truth.back().t_ns);
        mark_time(t_s);
        const bool overdue = t_s > nominal_s_;
        std::string text = fmt::format("t = {:.1f} s of {} {:.0f} s, {:.2f} m", t_s, overdue ? "at most" : "about",
                                       overdue ? scenario_.duration_s : nominal_s_, bus.truth.back().range_m());
        if (!bus.commands.empty())
            text += fmt::format(", {}, {}", leg_text(scenario_, bus.commands.back().leg),
                                kGuidancePhases[static_cast<std::size_t>(bus.commands.back().phase)]);
        text += judge_.failures() == 0 ? ", gates good" : fmt::format(", {} gate(s) FAILED", judge_.failures());
        if (stalled_s > kStalled_s)
            text += fmt::format(", no progress for {:.0f} s: {}", stalled_s, judge_.awaited());
        console_.progress(overdue ? -1 : t_s / nominal_s_, overdue ? -1 : left_s(t_s), text);
    }

    /// The speed changes as the target fills the frames: it is averaged over the last one to two kSpeedWindow_s.
    void mark_time(double t_s) {
        if (marks_.empty() || seconds_since(marks_.back().first) > kSpeedWindow_s)
            marks_.emplace_back(Clock::now(), t_s);
        if (marks_.size() > 2) marks_.erase(marks_.begin());
    }
    /// Remaining wall time; negative: not known yet.
    double left_s(double t_s) const {
        const auto& [then, t_then_s] = marks_.front();
        const double passed_s = seconds_since(then), speed = (t_s - t_then_s) / passed_s;
        return passed_s < 1 || !(speed > 0) ? -1 : (nominal_s_ - t_s) / speed + kEnding_s;
    }

    void show_ending(const char* what) {
        const BusRecord& bus = judge_.bus();
        if (bus.truth.empty()) return console_.progress(-1, -1, what);
        const double t_s = bus.seconds(bus.truth.back().t_ns);
        console_.progress(-1, -1, fmt::format("t = {:.1f} s of about {:.0f} s, {}", t_s, t_s, what));
    }

    /// Dynamics and navigation end by themselves after a good run; the emulator writes its logs at SIGTERM.
    void stop_programs() {
        const auto began = Clock::now();
        for (Program* p : {&dynamics_, &navigation_}) {
            if (!p->child) continue;
            while (trouble_.empty() && !p->ended() && seconds_since(began) < kEndPatience_s) receive();
            if (trouble_.empty()) trouble_ = p->failure();
            p->child->stop(trouble_.empty() ? 0 : 2);
        }
        emulator_.child->terminate();
        const auto asked = Clock::now();
        while (!emulator_.ended() && seconds_since(asked) < kEndPatience_s) receive();
        if (trouble_.empty()) trouble_ = emulator_.failure();
        emulator_.child->stop(0);
    }

    // --- Afterwards ---

    Result<RehearsalResult> write_results() {
        record_["wall_s"] = seconds_since(began_);
        record_["trouble"] = trouble_;
        const Pages pages = !options_.page ? Pages::none : options_.lean ? Pages::of_failed : Pages::all;
        RehearsalResult done = narpa::rehearsal::write_results(scenario_, judge_, record_, options_.folder, pages);
        keep_first(done.written, write_whole(in_folder("rehearsal.json"), record_.dump(2) + "\n"));
        if (options_.lean && done.verdict.passed && done.written) keep_lean_files();
        return done;
    }

    void keep_lean_files() const {
        std::error_code failed;
        std::vector<fs::path> files;
        for (const auto& entry : fs::recursive_directory_iterator(options_.folder, failed))
            if (!entry.is_directory(failed)) files.push_back(entry.path());
        for (const fs::path& file : files)
            if (std::ranges::find(kLeanFiles, fs::relative(file, options_.folder, failed).string()) ==
                kLeanFiles.end())
                fs::remove(file, failed);
        for (const char* folder : {"emulator", "navigation", "charts"}) fs::remove(in_folder(folder), failed);
    }

    const RehearsalOptions& options_;
    const Console& console_;
    const StopFlag& stop_;
    const Scenario scenario_;
    Judge judge_{scenario_, [this](const GateResult& g) { console_.print(live_text(g)); }};
    const double nominal_s_ = scenario_.nominal_duration_s();
    const Clock::time_point began_ = Clock::now();
    std::vector<std::pair<Clock::time_point, double>> marks_;  ///< wall time and simulation time
    Descriptor lock_;                                          ///< on the folder
    std::string hash_, bus_name_, trouble_;
    std::vector<std::string> video_, lidar_sinks_, lidar_sources_;  ///< NAME=SINK, NAME=SOURCE
    std::vector<std::string> fifos_;
    std::unique_ptr<CanBus> bus_;
    json record_;
    Program emulator_, navigation_, dynamics_;
};

}  // namespace

Result<RehearsalResult> run_rehearsal(const RehearsalOptions& options, const Console& console,
                                      const StopFlag& stop) {
    auto scenario = read_scenario(options.scenario, options.overrides);
    if (!scenario) return scenario.error();
    return Rehearsal(options, console, stop, *std::move(scenario)).run();
}

}  // namespace narpa::rehearsal
