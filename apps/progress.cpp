#include "apps/progress.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>

#include "apps/print_error.h"

namespace narpa::cli {
namespace {

using Seconds = std::chrono::duration<double>;

bool on_terminal() {
    return ::isatty(STDERR_FILENO) == 1;
}

/// Columns of the terminal: a longer line would wrap, and could not be rewritten.
std::size_t columns() {
    winsize size{};
    return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 ? size.ws_col - 1u : 79u;
}

std::string duration(double seconds) {
    if (seconds < 90) return fmt::format("{:.0f} s", seconds);
    if (seconds < 90 * 60) return fmt::format("{:.0f} min", seconds / 60);
    return fmt::format("{:.1f} h", seconds / 3600);
}

}  // namespace

std::string progress_line(const std::string& what, const Step& step, double seconds) {
    std::string line = what + ": ";
    if (!step.text.empty()) line += step.text + ", ";
    if (step.share < 0) return line + duration(seconds) + " so far";
    const double share = std::min(step.share, 1.0);
    line += fmt::format("{:.0f} %", 100 * share);
    // No estimate before 1 % and one second: it would be too uncertain.
    if (step.left_s >= 0)
        line += fmt::format(", about {} to go", duration(step.left_s));
    else if (share >= 0.01 && seconds >= 1)
        line += fmt::format(", about {} to go", duration(seconds * (1 - share) / share));
    return line;
}

double ProgressPace::next_s(const Step& step) {
    pause_s_ = step == last_ ? std::min(2 * pause_s_, kLongest_s) : kBetween_s;
    last_ = step;
    return pause_s_;
}

Progress::Progress(std::string what, std::function<Step()> poll)
    : what_(std::move(what)),
      poll_(std::move(poll)),
      thread_([this](const std::stop_token& stop) { print(stop); }) {}

Progress::~Progress() {
    thread_.request_stop();
    thread_.join();
    if (on_terminal()) print_error("\r\033[K");
}

void Progress::show(Step step) {
    const std::scoped_lock lock(mutex_);
    step_ = std::move(step);
}

void Progress::print(const std::stop_token& stop) {
    const bool terminal = on_terminal();
    constexpr double kRewritten_s = 0.3;
    ProgressPace pace;
    const auto began = std::chrono::steady_clock::now();
    std::mutex m;
    std::unique_lock lock(m);
    std::condition_variable_any woken;
    Seconds pause(terminal ? kRewritten_s : ProgressPace::kFirst_s);
    while (!woken.wait_for(lock, stop, pause, [&] { return stop.stop_requested(); })) {
        Step step;
        if (poll_) {
            step = poll_();
        } else {
            const std::scoped_lock held(mutex_);
            step = step_;
        }
        const std::string line =
            progress_line(what_, step, Seconds(std::chrono::steady_clock::now() - began).count());
        terminal ? print_error("\r\033[K{}", line.substr(0, columns())) : print_error("{}\n", line);
        std::fflush(stderr);
        pause = Seconds(terminal ? kRewritten_s : pace.next_s(step));
    }
}

void say(std::string_view text) {
    print_error("{}{}\n", on_terminal() ? "\r\033[K" : "", text);
}

}  // namespace narpa::cli
