/// rehearsal/program_main.h - main() of narpa-dynamics and narpa-navigation: arguments, errors, exit status.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <functional>
#include <iostream>

#include "base/ready.h"

namespace narpa::rehearsal {

/// Parses the arguments of `app`, which has the program's name, and calls `run`. Returns the exit status.
inline int run_program(CLI::App& app, int argc, char** argv, const std::function<Status()>& run) {
    app.set_version_flag("--version", NARPA_VERSION);
    app.footer(
        "Exit status: 0 good; 1 ran, but something failed; 2 bad input; 3 a device or permission is missing.");
    const auto fail = [&](const std::string& what, int status) {
        fmt::print(stderr, "{}: {}\n", app.get_name(), what);
        return status;
    };
    try {
        app.parse(argc, argv);
        const Status done = run();
        return done ? 0 : fail(done.error().text(), exit_status(done.error().kind));
    } catch (const CLI::ParseError& e) {
        return app.exit(e, std::cout, std::cerr) == 0 ? 0 : exit_status(ErrorKind::bad_input);
    } catch (const std::exception& e) {  // out of memory and the like: no code of ours throws
        return fail(e.what(), 1);
    }
}

inline void add_ready_fd(CLI::App& app, int& fd) {
    app.add_option("--ready-fd", fd, "Descriptor that gets the line READY=1 once the program is on the bus");
}

}  // namespace narpa::rehearsal
