/// apps/programs/program.h - main() of narpa-dynamics and narpa-navigation: arguments, errors, exit status.
#pragma once

#include <fmt/format.h>

#include <exception>
#include <functional>
#include <string>

#include "apps/options.h"
#include "apps/print_error.h"
#include "base/ready.h"
#include "base/result.h"

namespace narpa::cli {

/// Adds the options and --ready-fd, parses the command line and calls `run`. Returns the exit status.
inline int run_program(int argc, char** argv, const ProgramTexts& texts, int& ready_fd,
                       const std::function<void(Parser)>& add_options, const std::function<Status()>& run) {
    const auto fail = [&](const std::string& what, int status) {
        print_error("{}: {}\n", texts.name, what);
        return status;
    };
    const auto add_all = [&](const Parser& p) {
        add_options(p);
        p.option("--ready-fd", ready_fd, "Descriptor that gets the line READY=1 once the program is on the bus");
    };
    try {
        return parse_and_run(argc, argv, texts, add_all, [&] {
            Status done = check_ready_fd(ready_fd);
            if (done) done = run();
            return done ? 0 : fail(done.error().text(), exit_status(done.error().kind));
        });
    } catch (const std::exception& e) {  // such as out of memory: narpa's own code does not throw
        return fail(e.what(), 1);
    }
}

}  // namespace narpa::cli
