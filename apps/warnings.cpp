#include "apps/warnings.h"

#include <fmt/format.h>

#include "apps/progress.h"

namespace narpa::cli {
namespace {

/// Of the one command that a process runs.
struct WarningState {
    bool strict = false;
    int count = 0;
};

WarningState& warning_state() {
    static WarningState state;
    return state;
}

}  // namespace

void warn(std::string_view text) {
    ++warning_state().count;
    say(fmt::format("warning: {}", text));
}

Option add_strict_to(Parser app) {
    return app.flag("--strict", warning_state().strict, "Warnings are errors: exit status 1");
}

Status check_warnings(const std::string& file) {
    const auto [strict, count] = warning_state();
    if (!strict || count == 0) return Ok{};
    return Error{fmt::format("{} warning{}, expected none with --strict", count, count > 1 ? "s" : ""), file, 0, 0,
                 ErrorKind::failed};
}

}  // namespace narpa::cli
