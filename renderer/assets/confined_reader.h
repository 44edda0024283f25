/// renderer/assets/confined_reader.h - resource limits and output pipe of the programs that reader_process.h
/// starts.
#pragma once

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstddef>
#include <new>

namespace narpa {

/// Exit status of a reader that has no memory left; others are 0, or those of a crash.
inline constexpr int kOutOfMemory = 3;

/// Confines the calling process: it ends with its parent, has limits of memory and CPU time, and prints nothing.
inline void confine_reader(rlim_t memory_bytes, rlim_t seconds) {
    constexpr bool kSanitized = NARPA_SANITIZED;  // sanitizers reserve terabytes of addresses, and report on stderr
    const auto limit = [](decltype(RLIMIT_AS) what, rlim_t most) {
        const rlimit both{most, most};
        setrlimit(what, &both);
    };
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    std::set_new_handler([] { _exit(kOutOfMemory); });
    if (!kSanitized) limit(RLIMIT_AS, memory_bytes);
    limit(RLIMIT_CPU, seconds + 1);  // narpa kills it earlier, unless narpa itself has ended
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_FSIZE, 0);
    // narpa reports a crash; the C library's message would appear among narpa's own output.
    if (const int nothing = open("/dev/null", O_WRONLY); !kSanitized && nothing >= 0) dup2(nothing, STDERR_FILENO);
}

/// To standard output, which is the pipe to narpa.
struct PipeSender {
    static constexpr bool kReceives = false;
    static bool bytes(const void* data, std::size_t size) {
        for (const auto* at = static_cast<const char*>(data); size > 0;) {
            const ssize_t n = write(STDOUT_FILENO, at, size);
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) return false;
            at += n, size -= static_cast<std::size_t>(n);
        }
        return true;
    }
};

}  // namespace narpa
