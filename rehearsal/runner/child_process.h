/// rehearsal/runner/child_process.h - another program, started, watched and ended.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"

namespace narpa::rehearsal {

/// Runs in a process group of its own, so that what it starts ends with it, and ends when its parent does.
class ChildProcess {
public:
    struct Command {
        std::string name;                                              ///< "dynamics", for people
        std::vector<std::string> line;                                 ///< program (a path) and arguments
        std::vector<std::pair<std::string, std::string>> environment;  ///< added to ours
        std::string out, err;                                          ///< files; the same one may take both
    };
    /// The line as a shell would take it.
    [[nodiscard]] static std::string shell_line(const Command& command);

    static Result<ChildProcess> start(const Command& command);
    ChildProcess(ChildProcess&& other) noexcept : pid_(std::exchange(other.pid_, -1)), status_(other.status_) {}
    ChildProcess& operator=(ChildProcess&& other) noexcept;
    ~ChildProcess() { end(0); }

    /// Its exit status, or 128 + the signal that ended it; nothing while it runs.
    std::optional<int> status();
    /// SIGTERM, and SIGKILL if that has not helped after `patience_s`. Waits for the end.
    void end(double patience_s);
    /// Asks it to end, and does not wait.
    void terminate() const;

private:
    explicit ChildProcess(pid_t pid) : pid_(pid) {}
    pid_t pid_ = -1;
    std::optional<int> status_;
};

/// The folder of the running program.
[[nodiscard]] std::string program_folder();
/// The last line of a text file that says something; empty where there is none.
[[nodiscard]] std::string last_line(const std::string& file);
[[nodiscard]] std::string read_text(const std::string& file);

}  // namespace narpa::rehearsal
