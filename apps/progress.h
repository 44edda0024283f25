/// apps/progress.h - progress of a long command on standard error: what it does, the share done, the time left.
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <thread>

namespace narpa::cli {

/// Progress of a command.
struct Step {
    double share = -1;   ///< of the whole, 0 to 1; negative: unknown
    std::string text{};  ///< "frame 3 of 10"; may be empty
    double left_s = -1;  ///< wall time to the end; negative: extrapolated from the share and the elapsed time

    bool operator==(const Step&) const = default;
};

/// When the lines of a log, which nobody rewrites, are due: after two seconds and then every ten; while nothing
/// moves after twice the time each, up to an hour.
class ProgressPace {
public:
    /// Seconds to the next line, after one that showed this step.
    double next_s(const Step& step);
    static constexpr double kFirst_s = 2, kBetween_s = 10, kLongest_s = 3600;

private:
    Step last_{};
    double pause_s_ = kFirst_s;
};

/// "rendering: frame 3 of 10, 30 %, about 35 s to go", or with the elapsed time where the share is unknown.
[[nodiscard]] std::string progress_line(const std::string& what, const Step& step, double seconds);

/// On a terminal one line that is rewritten, and removed at the end; elsewhere lines at ProgressPace. A thread of
/// its own prints, so that the lines come however long a step takes.
class Progress {
public:
    /// `what`: "rendering camera nav". `poll`: called by that thread to get the step; empty: `show` sets it.
    explicit Progress(std::string what, std::function<Step()> poll = {});
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    void show(Step step);
    void show(double share, std::string text = {}) { show({share, std::move(text)}); }
    void show(std::string text) { show(-1, std::move(text)); }

private:
    void print(const std::stop_token& stop);

    const std::string what_;
    std::mutex mutex_;
    Step step_{};  ///< guarded by mutex_
    std::function<Step()> poll_;
    std::jthread thread_;
};

/// Prints a line on standard error; on a terminal it replaces the line of progress.
void say(std::string_view text);

}  // namespace narpa::cli
