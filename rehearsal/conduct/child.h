/// rehearsal/conduct/child.h - another program, started, watched and ended.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"

namespace narpa::rehearsal {

/// Runs in a process group of its own, so that what it starts ends with it, and ends when its parent does.
class Child {
public:
    struct Command {
        std::string name;                                              ///< "dynamics", for people
        std::vector<std::string> line;                                 ///< program (a path) and arguments
        std::vector<std::pair<std::string, std::string>> environment;  ///< added to ours
        std::string out, err;                                          ///< files; the same one may take both
    };
    /// The line as a shell would take it.
    [[nodiscard]] static std::string in_words(const Command& command);

    static Result<Child> start(const Command& command);
    Child(Child&& other) noexcept : pid_(std::exchange(other.pid_, -1)), status_(other.status_) {}
    Child& operator=(Child&& other) noexcept;
    ~Child() { end(0); }

    /// Its exit status, or 128 + the signal that ended it; nothing while it runs.
    std::optional<int> status();
    /// SIGTERM, and SIGKILL if that has not helped after `patience_s`. Waits for the end.
    void end(double patience_s);
    /// Asks it to end, and does not wait.
    void ask_to_end() const;

private:
    explicit Child(pid_t pid) : pid_(pid) {}
    pid_t pid_ = -1;
    std::optional<int> status_;
};

/// The folder of the running program.
[[nodiscard]] std::string program_folder();
/// The last line of a text file that says something; empty where there is none.
[[nodiscard]] std::string last_line(const std::string& file);
[[nodiscard]] std::string read_text(const std::string& file);

}  // namespace narpa::rehearsal
