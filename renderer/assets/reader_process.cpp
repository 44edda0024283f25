#include "renderer/assets/reader_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <utility>

#include "base/program_beside.h"
#include "renderer/assets/confined_reader.h"

namespace narpa {

int ReaderProcess::start(const std::string& program, std::vector<std::string> arguments) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) return errno;
    out_ = ends[0];
    constexpr int kPipeBytes = 1 << 20;  // what Linux lets any user have; its default is 64 KiB
    ::fcntl(out_, F_SETPIPE_SZ, kPipeBytes);
    arguments.insert(arguments.begin(), program_beside(program));
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    sigset_t none;
    sigemptyset(&none);
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends[1], STDOUT_FILENO);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    const int failed = posix_spawnp(&pid_, argv[0], &files, &attributes, argv.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    ::close(ends[1]);
    return failed;
}

ReaderProcess::~ReaderProcess() {
    end();
    if (out_ >= 0) ::close(out_);
}

int ReaderProcess::end() {
    if (const pid_t pid = std::exchange(pid_, -1); pid > 0) {
        ::kill(pid, SIGKILL);
        while (::waitpid(pid, &status_, 0) < 0 && errno == EINTR) {
        }
    }
    return status_;
}

bool PipeReceiver::bytes(void* data, std::size_t size) {
    if (size > left_) return false;
    left_ -= size;
    for (char* at = static_cast<char*>(data); size > 0;) {
        if (!wait()) return false;
        const ssize_t n = ::read(fd_, at, size);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        at += n, size -= static_cast<std::size_t>(n);
    }
    return true;
}

bool PipeReceiver::wait() {
    for (;;) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline_ - Clock::now()).count();
        pollfd end{fd_, POLLIN, 0};
        const int ready = left > 0 ? ::poll(&end, 1, static_cast<int>(left)) : 0;
        if (ready == 0) timed_out_ = true;
        if (ready >= 0 || errno != EINTR) return ready > 0;
    }
}

std::string why_it_ended(const std::string& reader, int status, std::uint64_t memory_bytes) {
    if (WIFEXITED(status) && WEXITSTATUS(status) == kOutOfMemory)
        return fmt::format("{} ran out of memory (limit {:.3g} GiB)", reader,
                           static_cast<double>(memory_bytes) / (std::uint64_t{1} << 30));
    const std::string how = WIFSIGNALED(status) ? fmt::format("signal {}", WTERMSIG(status))
                                                : fmt::format("exit status {}", WEXITSTATUS(status));
    return fmt::format("{} crashed ({})", reader, how);
}

}  // namespace narpa
