// tests/support/command.h - another program, run to its end.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace narpa::test {

struct Done {
    int status = -1;  ///< exit status; -1: it did not start, or a signal ended it
    std::string out;  ///< what it wrote on standard output
};

/// Prefix of a program that could hang: exit status 124 after this time. No build needs as long, even a sanitizer's
/// on a slow, busy machine.
inline constexpr const char* kTimeLimit = "timeout 1800 ";

/// A command of the shell, which can send standard error elsewhere.
inline Done run_command(const std::string& command) {
    Done done;
    std::FILE* pipe = ::popen(command.c_str(), "r");
    if (pipe == nullptr) return done;
    for (std::array<char, 4096> part; const std::size_t n = std::fread(part.data(), 1, part.size(), pipe);)
        done.out.append(part.data(), n);
    const int status = ::pclose(pipe);
    if (WIFEXITED(status)) done.status = WEXITSTATUS(status);
    return done;
}

}  // namespace narpa::test
