#include "rehearsal/runner/program.h"

#include <fmt/format.h>

namespace narpa::rehearsal {

Status Program::start(const std::string& name, const std::string& folder) {
    command.name = "the " + name;
    command.out = command.err = folder + "/" + name + ".log";
    auto started = ChildProcess::start(command);
    if (!started) return started.error();
    child = std::move(*started);
    return Ok{};
}

std::string Program::failure() {
    const auto status = child ? child->status() : std::nullopt;
    if (!status || *status == 0) return "";
    const std::string how =
        *status > 128 ? fmt::format("signal {}", *status - 128) : fmt::format("status {}", *status);
    const std::string said = last_line(command.err);
    return fmt::format("{} ended with {}{}", command.name, how, said.empty() ? "" : ": " + said);
}

Error Program::start_error(const std::string& what) {
    const int status = child ? child->status().value_or(1) : 1;
    const ErrorKind kind = status == 2   ? ErrorKind::bad_input
                           : status == 3 ? ErrorKind::missing
                                         : ErrorKind::failed;
    return {what, command.err, 0, 0, kind};
}

}  // namespace narpa::rehearsal
