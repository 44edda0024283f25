// narpa - hardware-in-the-loop camera and LiDAR emulator. This file: subcommands, --json, exit status.
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <exception>
#include <mutex>

#include "apps/cli.h"
#include "renderer/scene/scene_file.h"

namespace narpa::cli {

void say(std::string_view text) {
    fmt::print(stderr, "{}\n", text);
}

Progress::Progress() : terminal_(::isatty(STDERR_FILENO) == 1) {}
Progress::~Progress() {
    if (terminal_) fmt::print(stderr, "\r{:<60}\r", "");
}
void Progress::show(const std::string& text) const {
    if (terminal_) fmt::print(stderr, "\r{:<60}", text), std::fflush(stderr);
}

ProgressThread::ProgressThread(std::function<std::string()> text) {
    if (::isatty(STDERR_FILENO) != 1) return;
    thread_ = std::jthread([text = std::move(text)](const std::stop_token& stop) {
        const Progress line;
        std::mutex m;
        std::unique_lock lock(m);
        std::condition_variable_any woken;
        while (!woken.wait_for(lock, stop, std::chrono::seconds(1), [&] { return stop.stop_requested(); }))
            line.show(text());
    });
}

Result<Scene> load_scene(const std::string& path, std::optional<RenderSettings::Method> method) {
    auto scene = read_scene(path);
    if (!scene) return scene;
    if (method)
        if (const Status good = use_method(*scene, *method); !good) return good.error();
    for (const std::string& w : scene->warnings) say("warning: " + w);
    return scene;
}

Result<std::pair<std::string, std::string>> split_pair(const std::string& text, std::string_view expected) {
    const std::size_t at = text.find('=');
    if (at == std::string::npos || at == 0 || at + 1 == text.size())
        return Error{fmt::format("\"{}\", expected {}", text, expected)};
    return std::pair{text.substr(0, at), text.substr(at + 1)};
}

namespace {

nlohmann::json to_json(const Error& e) {
    return {{"error",
             {{"what", e.what},
              {"file", e.file},
              {"line", e.line},
              {"column", e.column},
              {"remedy", e.remedy},
              {"exit_status", exit_status(e.kind)}}}};
}

/// False: standard output did not take it.
bool print_json(const nlohmann::json& document) {
    fmt::print("{}\n", document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
    if (std::fflush(stdout) == 0) return true;
    say(fmt::format("narpa: standard output cannot be written: {}", std::strerror(errno)));
    return false;
}

int finish(const Outcome& outcome, bool json) {
    if (!outcome) {
        say("narpa: " + outcome.error().text());
        if (json) print_json(to_json(outcome.error()));
        return exit_status(outcome.error().kind);
    }
    if (json && !print_json(*outcome)) return exit_status(ErrorKind::failed);
    return outcome->is_object() && !outcome->value("passed", true) ? exit_status(ErrorKind::failed) : 0;
}

Command add_bench(Parser app) {
    const Parser bench = app.subcommand("bench", "Measure speed against error");
    auto chosen = std::make_shared<Command>();
    bench.choice<Command>({add_bench_render, add_bench_loop, add_bench_estimate}, *chosen);
    return [chosen] { return (*chosen)(); };
}

constexpr const char* kDescription =
    "narpa emulates a spacecraft's camera and LiDAR: poses in on CAN, camera frames out on V4L2, LiDAR packets "
    "out on UDP.";
constexpr const char* kFooter =
    "Exit status: 0 good; 1 ran, but something failed; 2 bad input; 3 a device or permission is missing.";

int run(int argc, char** argv) {
    bool json = false;
    Command chosen;
    const auto add_subcommands = [&](const Parser& app) {
        app.choice<Command>(
            {add_check, add_run, add_fly, add_render, add_scan, add_replay, add_estimate, add_rehearse, add_bench},
            chosen);
    };
    return parse_and_run(argc, argv, {kDescription, NARPA_VERSION, kFooter}, json, add_subcommands,
                         [&] { return finish(chosen(), json); });
}

}  // namespace
}  // namespace narpa::cli

int main(int argc, char** argv) {
    try {
        return narpa::cli::run(argc, argv);
    } catch (const std::exception& e) {  // out of memory and the like: nothing of ours throws
        fmt::print(stderr, "narpa: {}\n", e.what());
        return 1;
    }
}
