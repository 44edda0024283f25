/// rehearsal/runner/child_process.h - starts, watches and stops another program.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "drivers/descriptor.h"

namespace narpa::rehearsal {

/// Runs in its own process group, so that the programs it starts are stopped with it; the kernel stops it when its
/// parent ends.
class ChildProcess {
public:
    /// How the program receives the descriptor of base/ready.h: not at all, by `--ready-fd N` after its arguments,
    /// or by the environment variable READY_FD.
    enum class Ready : std::uint8_t { none, option, variable };
    struct Command {
        std::string name;                                              ///< "the dynamics", for people
        std::vector<std::string> line;                                 ///< program (a path) and arguments
        std::vector<std::pair<std::string, std::string>> environment;  ///< added to the parent's
        std::string out, err;                                          ///< files; one file may take both
        Ready ready = Ready::none;
    };
    /// The command line, quoted for a shell.
    [[nodiscard]] static std::string shell_line(const Command& command);

    static Result<ChildProcess> start(Command command);
    ChildProcess(ChildProcess&& other) noexcept { *this = std::move(other); }
    ChildProcess& operator=(ChildProcess&& other) noexcept;
    ~ChildProcess() { stop(0); }

    /// Exit status, or 128 + the signal that ended it; empty while it runs.
    std::optional<int> status();
    /// The program's lines KEY=VALUE once READY=1 has arrived; does not wait.
    [[nodiscard]] std::optional<std::string> ready();
    /// Waits until `ready` may have something new or the time is over.
    void wait_ready(std::int64_t timeout_ns) const;
    /// SIGTERM; does not wait.
    void terminate() const;
    /// SIGTERM, then SIGKILL after `grace_s`. Waits for the end.
    void stop(double grace_s);

private:
    ChildProcess(pid_t pid, Descriptor ready) : pid_(pid), ready_(std::move(ready)) {}
    pid_t pid_ = -1;
    std::optional<int> status_;
    Descriptor ready_;
    std::string ready_text_;
};

/// The value of a line KEY=VALUE; empty where there is none.
[[nodiscard]] std::string value_of(const std::string& lines, const std::string& key);

/// The last line of a text file that is not blank; empty where there is none.
[[nodiscard]] std::string last_line(const std::string& file);
/// The error that one of our programs printed, without "narpa: ", with its remedy; else the last line.
[[nodiscard]] std::string error_in(const std::string& file);
[[nodiscard]] std::string read_text(const std::string& file);

struct Program {
    ChildProcess::Command command{};
    std::optional<ChildProcess> child{};  ///< empty: not started, or started by the user

    /// Output goes to FOLDER/NAME.log.
    Status start(const std::string& name, const std::string& folder);
    [[nodiscard]] bool ended() { return child && child->status(); }
    /// "the navigation ended with status 7: its error"; empty while it runs and after status 0.
    [[nodiscard]] std::string failure();
    /// An Error of the kind that its exit status stands for; kind `failed` for a program of the user's.
    [[nodiscard]] Error start_error(const std::string& what);
};

}  // namespace narpa::rehearsal
