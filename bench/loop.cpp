#include "bench/loop.h"

#include <fmt/format.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>

#include "emulator/log/statistics.h"
#include "plot/plot.h"

namespace narpa {
namespace {

using nlohmann::json;

/// The body of the child process, which never returns. It does not touch the memory copied from its parent.
[[noreturn]] void keep_busy(int cpu, pid_t parent) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(0);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<std::size_t>(cpu), &one);
    if (::sched_setaffinity(0, sizeof one, &one) != 0) ::_exit(1);
    for (volatile std::uint64_t n = 0;;) n = n + 1;
}

json to_json(const CameraRun& c) {
    json out = c.report;
    out.update({{"period_ms", static_cast<double>(c.period_ns) * 1e-6},
                {"allowance_ms", static_cast<double>(c.allowance_ns) * 1e-6},
                {"late", c.stats.deadline_missed},
                {"late_fraction", c.late_fraction()},
                {"incomplete", c.incomplete()},
                {"radiance_ms", percentiles(c.stats.radiance, 1e-6)},
                {"sensor_ms", percentiles(c.stats.sensor, 1e-6)},
                {"send_ms", percentiles(c.stats.send, 1e-6)}});
    for (const auto& [name, p] : kPercentiles) out["allowance_used"][name] = c.allowance_used(p);
    if (!c.flown.empty()) out["by_range"] = by_range(c.flown);
    return out;
}

/// "1.23 / 4.56 / 7.89": median, 99.9th percentile and maximum, ms.
template <class H>
std::string ms(const H& h) {
    return fmt::format("{:.2f} / {:.2f} / {:.2f}", h.percentile_ns(0.5) * 1e-6, h.percentile_ns(0.999) * 1e-6,
                       h.percentile_ns(1) * 1e-6);
}

/// Times of the stages, samples per pixel, refinement steps and expected error.
std::string frames_text(const CameraStats& s) {
    std::string steps;
    for (std::size_t i = 0; i < kStepNames.size(); ++i)
        if (s.steps[i] > 0) steps += fmt::format("{}{} {}", steps.empty() ? "" : ", ", s.steps[i], kStepNames[i]);
    std::string out =
        fmt::format("radiance {}; sensor {}; sinks {}; samples per pixel p50 {:.2f} ({}); {}", ms(s.radiance),
                    ms(s.sensor), ms(s.send), s.samples_1e3.percentile_ns(0.5) * 1e-3, kSamplesPerPixelNote, steps);
    if (s.error_1e9.count() > 0)
        out += fmt::format("; expected error p50 {:.3g} % of scale", s.error_1e9.percentile_ns(0.5) * 1e-7);
    return out;
}

CameraRun of(const CameraSensor& feed, const RenderSettings& render) {
    const CameraUnit& unit = feed.unit();
    const std::int64_t period = unit.camera().period_ns;
    return {unit.camera().name, period, render.budget_ns > 0 ? render.budget_ns : period - unit.exposure_ns() / 2,
            feed.stats(), feed.report()};
}

}  // namespace

Result<CompetingLoad> CompetingLoad::start(const std::vector<int>& cpus) {
    CompetingLoad load;
    const pid_t parent = ::getpid();
    for (const int cpu : cpus) {
        const pid_t child = ::fork();
        if (child == 0) keep_busy(cpu, parent);
        if (child < 0)
            return Error{fmt::format("no process to keep processor {} busy: {}", cpu, std::strerror(errno))};
        load.processes_.push_back(child);
    }
    return load;
}

CompetingLoad::~CompetingLoad() {
    for (const pid_t child : processes_) ::kill(child, SIGKILL);
    for (const pid_t child : processes_) ::waitpid(child, nullptr, 0);
}

double CameraRun::late_fraction() const noexcept {
    const std::uint64_t due = stats.frames + stats.skipped;
    return due == 0 ? 0 : static_cast<double>(stats.deadline_missed + stats.skipped) / static_cast<double>(due);
}

double CameraRun::allowance_used(double p) const noexcept {
    return 1 + stats.late.percentile_ns(p) / static_cast<double>(allowance_ns);
}

Result<LoopRun> run_loop(const std::string& name, const Scene& scene, const RunOptions& options,
                         const std::vector<int>& load, const StopFlag& stop) {
    // Forks before the run allocates its memory: copy-on-write would make its pages fault once more.
    auto competing = CompetingLoad::start(load);
    if (!competing) return competing.error();
    RunOptions watched = options;
    std::vector<std::shared_ptr<Flown>> flown;
    if (!options.bus.empty())
        for (std::size_t camera = 0; camera < scene.cameras.size(); ++camera) {
            flown.push_back(std::make_shared<Flown>());
            watched.observers.push_back(watch_flight(camera, flown.back()));
        }
    auto emulator = Emulator::create(scene, watched);
    if (!emulator) return emulator.error();
    if (auto done = (*emulator)->run(stop); !done) return done.error();

    LoopRun run{name, load, {}, {}, (*emulator)->page_faults(), (*emulator)->notices()};
    for (const CameraSensor* camera : (*emulator)->cameras()) run.cameras.push_back(of(*camera, scene.render));
    for (std::size_t camera = 0; camera < flown.size(); ++camera) run.cameras[camera].flown = *flown[camera];
    for (const LidarSensor* lidar : (*emulator)->lidars())
        run.lidars.push_back({std::string(lidar->name()), lidar->stats(), lidar->report()});
    return run;
}

std::vector<std::string> loop_faults(const std::vector<LoopRun>& runs, double late_max) {
    std::vector<std::string> faults;
    for (const LoopRun& run : runs)
        for (const CameraRun& c : run.cameras) {
            if (c.stats.frames + c.stats.skipped == 0)
                faults.push_back(
                    fmt::format("{}, camera {}: no frame fell due, expected one at least", run.name, c.name));
            if (c.incomplete() > 0)
                faults.push_back(fmt::format("{}, camera {}: {} frames without a whole image, expected none",
                                             run.name, c.name, c.incomplete()));
            if (c.late_fraction() > late_max)
                faults.push_back(
                    fmt::format("{}, camera {}: {:.3g} % of the frames late, expected at most {:.3g} %", run.name,
                                c.name, 100 * c.late_fraction(), 100 * late_max));
        }
    return faults;
}

json to_json(const LoopRun& run) {
    json cameras = json::array(), lidars = json::array();
    for (const CameraRun& c : run.cameras) cameras.push_back(to_json(c));
    for (const LidarRun& l : run.lidars) lidars.push_back(l.report);
    return {{"name", run.name},
            {"load", run.load},
            {"cameras", cameras},
            {"lidars", lidars},
            {"page_faults", {{"minor", run.page_faults.minor}, {"major", run.page_faults.major}}},
            {"notices", run.notices}};
}

std::string to_text(const std::vector<LoopRun>& runs) {
    std::string out = "times in ms: p50 / p99.9 / max; from the deadline: negative is before\n";
    out += fmt::format("{:>7} {:>8} {:>7} {:>5} {:>5} {:>5} {:>22} {:>24} {:>24} {:>26} {:>8}\n", "run", "sensor",
                       "frames", "late", "lost", "part", "woken late", "render", "mid-exposure to out",
                       "out, from the deadline", "used p50");
    for (const LoopRun& run : runs) {
        for (const CameraRun& c : run.cameras) {
            const CameraStats& s = c.stats;
            out +=
                fmt::format("{:>7} {:>8} {:>7} {:>5} {:>5} {:>5} {:>22} {:>24} {:>24} {:>26} {:>7.1f}%\n", run.name,
                            c.name, s.frames, s.deadline_missed, s.skipped, c.incomplete(), ms(s.wake_late),
                            ms(s.render), ms(s.hand_over), ms(s.late), 100 * c.allowance_used(0.5));
            out += fmt::format("{:>7} {:>8} {}\n", "", "", frames_text(s));
            out += fmt::format("{:>7} {:>8} handed over: {}\n", run.name, c.name, lateness_text(s.late));
            if (!c.flown.empty()) out += by_range_text(c.flown);
        }
        for (const LidarRun& l : run.lidars)
            out += fmt::format("{:>7} {:>8} {:>7} {:>5} {:>5} {:>5} {:>22} {:>24} {:>24}\n", run.name, l.name,
                               l.stats.packets, "", l.stats.skipped, "", ms(l.stats.wake_late), ms(l.stats.fire),
                               ms(l.stats.hand_over));
        out += fmt::format("{:>7} page faults while frames were made: {} minor, {} major\n", run.name,
                           run.page_faults.minor, run.page_faults.major);
        for (const std::string& notice : run.notices) out += fmt::format("{:>7} {}\n", run.name, notice);
    }
    return out;
}

namespace {

/// Pairs of ms and the fraction of the frames that exceed it, down to the one frame that took longest: one for each
/// of the longest hundred, thinned out before them. `min_ms`: a logarithmic axis needs a positive number.
template <class H>
nlohmann::json exceedance(const H& h, double min_ms) {
    nlohmann::json points = nlohmann::json::array();
    const auto n = static_cast<double>(h.count());
    for (double k = n; k >= 1; k = std::min(k - 1, std::floor(k * (k > 100 ? 0.97 : 1))))
        points.push_back({std::max(min_ms, h.percentile_ns((n - k + 1) / n) * 1e-6), k / n});
    return points;
}

}  // namespace

Status plot_loop(const std::string& path, const std::string& title, const std::vector<LoopRun>& runs) {
    constexpr double kMin_ms = 1e-3;
    nlohmann::json of_runs = nlohmann::json::array();
    for (const LoopRun& run : runs) {
        nlohmann::json cameras = nlohmann::json::array();
        for (const CameraRun& c : run.cameras)
            cameras.push_back({{"name", c.name},
                               {"wake_late_ms", exceedance(c.stats.wake_late, kMin_ms)},
                               {"hand_over_ms", exceedance(c.stats.hand_over, kMin_ms)},
                               {"late_ms", exceedance(c.stats.late, -1e9)}});
        of_runs.push_back({{"name", run.name}, {"cameras", cameras}});
    }
    return write_plot(path, {{"plot", "loop"}, {"title", title}, {"runs", of_runs}});
}

}  // namespace narpa
