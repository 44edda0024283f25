/// base/ready.h - readiness notification between programs. A program started with `--ready-fd N` writes lines
/// KEY=VALUE to descriptor N once it can be reached: the addresses it listens on, then READY=1 (as sd_notify(3)
/// does); then it closes N. End of file without READY=1 means that the program ended before it was ready.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

inline constexpr std::string_view kReadyLine = "READY=1\n";

/// `fd` < 0: not given. Also sets close-on-exec, so that child processes do not inherit the descriptor.
inline Status check_ready_fd(int fd) {
    if (fd >= 0 && ::fcntl(fd, F_SETFD, FD_CLOEXEC) != 0)
        return Error{"--ready-fd " + std::to_string(fd) + ": expected an open descriptor"};
    return Ok{};
}

/// `addresses`: lines KEY=VALUE. It is no error if the reader has closed its end.
inline void notify_ready(int fd, std::string addresses = {}) {
    if (fd < 0) return;
    addresses += kReadyLine;
    for (std::string_view left = addresses; !left.empty();) {
        const ssize_t n = ::write(fd, left.data(), left.size());
        if (n <= 0) break;
        left.remove_prefix(static_cast<std::size_t>(n));
    }
    ::close(fd);
}

}  // namespace narpa
