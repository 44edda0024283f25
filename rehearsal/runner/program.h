/// rehearsal/runner/program.h - one of the three programs of a rehearsal.
#pragma once

#include <optional>
#include <string>

#include "rehearsal/runner/child_process.h"

namespace narpa::rehearsal {

struct Program {
    ChildProcess::Command command{};
    std::optional<ChildProcess> child{};  ///< empty: not started, or started by the user

    /// Output goes to FOLDER/NAME.log.
    Status start(const std::string& name, const std::string& folder);
    [[nodiscard]] bool ended() { return child && child->status(); }
    /// "the navigation ended with status 7: its last line"; empty while it runs and after status 0.
    [[nodiscard]] std::string failure();
    /// An Error of the kind that its exit status stands for.
    [[nodiscard]] Error start_error(const std::string& what);
};

}  // namespace narpa::rehearsal
