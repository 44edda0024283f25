#include "apps/warnings.h"

#include <fmt/format.h>

#include "apps/progress.h"

namespace narpa::cli {
namespace {

/// Of the one command that a process runs.
struct WarningState {
    bool strict = false;
    std::vector<std::string> texts{};
};

WarningState& warning_state() {
    static WarningState state;
    return state;
}

}  // namespace

void warn(std::string_view text) {
    warning_state().texts.emplace_back(text);
    say(fmt::format("warning: {}", text));
}

const std::vector<std::string>& warnings() {
    return warning_state().texts;
}

Option add_strict_to(Parser app) {
    return app.flag("--strict", warning_state().strict, "Warnings are errors: exit status 1");
}

Status check_warnings(const std::string& file) {
    const std::size_t count = warnings().size();
    if (!warning_state().strict || count == 0) return Ok{};
    return Error{fmt::format("{} warning{}, expected none with --strict", count, count > 1 ? "s" : ""), file, 0, 0,
                 ErrorKind::failed};
}

}  // namespace narpa::cli
