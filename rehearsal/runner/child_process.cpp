#include "rehearsal/runner/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <thread>

#include "base/ready.h"

namespace narpa::rehearsal {
namespace {

using namespace std::chrono_literals;

int open_for_output(const std::string& file) {
    return ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
}

/// The child's end of the pipe of base/ready.h.
constexpr int kReadyFd = 3;

/// Runs between fork and exec: must not allocate.
[[noreturn]] void become(char* const* line, char* const* environment, int in, int out, int err, int ready) {
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    ::signal(SIGPIPE, SIG_DFL);
    ::signal(SIGINT, SIG_DFL);
    ::signal(SIGTERM, SIG_DFL);
    ::dup2(in, STDIN_FILENO);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(err, STDERR_FILENO);
    if (ready == kReadyFd) ::fcntl(ready, F_SETFD, 0);  // dup2 onto itself would leave it close-on-exec
    if (ready >= 0 && ready != kReadyFd) ::dup2(ready, kReadyFd);
    ::execve(line[0], line, environment);
    ::_exit(127);
}

std::vector<char*> pointers(const std::vector<std::string>& texts) {
    std::vector<char*> out;
    for (const std::string& t : texts) out.push_back(const_cast<char*>(t.c_str()));
    out.push_back(nullptr);
    return out;
}

std::vector<std::string> environment_with(const std::vector<std::pair<std::string, std::string>>& added) {
    std::vector<std::string> out;
    for (char** e = environ; *e != nullptr; ++e) {
        const std::string entry = *e;
        bool replaced = false;
        for (const auto& [name, value] : added) replaced |= entry.starts_with(name + "=");
        if (!replaced) out.push_back(entry);
    }
    for (const auto& [name, value] : added) out.push_back(fmt::format("{}={}", name, value));
    return out;
}

}  // namespace

std::string ChildProcess::shell_line(const Command& command) {
    const auto quoted = [](const std::string& text) {
        std::string out = "'";
        for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
        return out + "'";
    };
    std::string out;
    for (const auto& [name, value] : command.environment) out += fmt::format("{}={} ", name, quoted(value));
    for (const std::string& part : command.line) {
        const bool plain = !part.empty() && part.find_first_of(" \t\n'\"$&;|<>*?()#~`\\!{}[]") == std::string::npos;
        out += (plain ? part : quoted(part)) + ' ';
    }
    if (!out.empty()) out.pop_back();
    return out;
}

Result<ChildProcess> ChildProcess::start(Command command) {
    if (command.ready == Ready::option)
        command.line.insert(command.line.end(), {"--ready-fd", std::to_string(kReadyFd)});
    if (command.ready == Ready::variable) command.environment.emplace_back("READY_FD", std::to_string(kReadyFd));
    const std::vector<std::string> environment = environment_with(command.environment);
    const std::vector<char*> line = pointers(command.line), variables = pointers(environment);
    if (::access(line[0], X_OK) != 0)
        return Error{
            fmt::format("cannot start {}: {}, expected an executable program", command.name, std::strerror(errno)),
            command.line[0]};
    const Descriptor in(::open("/dev/null", O_RDONLY | O_CLOEXEC)), out(open_for_output(command.out)),
        err(open_for_output(command.err));
    std::array<int, 2> ends{-1, -1};
    bool open = in && out && err;
    if (open && command.ready != Ready::none) open = ::pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) == 0;
    Descriptor read_end(ends[0]);
    const Descriptor write_end(ends[1]);
    const pid_t pid = open ? ::fork() : -1;
    if (pid == 0) become(line.data(), variables.data(), in.get(), out.get(), err.get(), write_end.get());
    if (pid < 0)
        return Error{fmt::format("cannot start {}: {}", command.name, std::strerror(errno)), command.err, 0, 0,
                     ErrorKind::failed};
    ::setpgid(pid, pid);  // parent and child both call it: whichever is first
    return ChildProcess(pid, std::move(read_end));
}

ChildProcess& ChildProcess::operator=(ChildProcess&& other) noexcept {
    stop(0);
    pid_ = std::exchange(other.pid_, -1);
    status_ = other.status_;
    ready_ = std::move(other.ready_);
    ready_text_ = std::move(other.ready_text_);
    return *this;
}

std::optional<std::string> ChildProcess::ready() {
    std::array<char, 512> text;
    for (ssize_t n = 0; ready_ && (n = ::read(ready_.get(), text.data(), text.size())) > 0;)
        ready_text_.append(text.data(), static_cast<std::size_t>(n));
    if (("\n" + ready_text_).find("\n" + std::string(kReadyLine)) == std::string::npos) return std::nullopt;
    return ready_text_;
}

std::optional<int> ChildProcess::status() {
    if (pid_ < 0 || status_) return status_;
    int how = 0;
    const pid_t ended = ::waitpid(pid_, &how, WNOHANG);
    if (ended == 0 || (ended < 0 && errno == EINTR)) return std::nullopt;
    status_ = WIFEXITED(how) ? WEXITSTATUS(how) : 128 + WTERMSIG(how);
    return status_;
}

void ChildProcess::wait_ready(std::int64_t timeout_ns) const {
    pollfd end{ready_.get(), POLLIN, 0};
    narpa::wait_ready({&end, 1}, timeout_ns);
}

void ChildProcess::terminate() const {
    if (pid_ > 0 && !status_) ::kill(-pid_, SIGTERM);
}

void ChildProcess::stop(double grace_s) {
    if (pid_ < 0) return;
    terminate();
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(grace_s);
    while (!status() && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(5ms);
    ::kill(-pid_, SIGKILL);  // also kills what it started and left behind
    while (!status()) std::this_thread::sleep_for(1ms);
    pid_ = -1;
}

std::string value_of(const std::string& lines, const std::string& key) {
    const std::string all = "\n" + lines, line = "\n" + key + "=";
    const std::size_t at = all.find(line);
    if (at == std::string::npos) return "";
    const std::size_t begin = at + line.size();
    return all.substr(begin, all.find('\n', begin) - begin);
}

std::string read_text(const std::string& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
}

std::string last_line(const std::string& file) {
    const std::string text = read_text(file);
    const std::size_t end = text.find_last_not_of(" \t\r\n");
    if (end == std::string::npos) return "";
    const std::size_t start = text.find_last_of("\r\n", end);
    return text.substr(start == std::string::npos ? 0 : start + 1, end - (start == std::string::npos ? -1 : start));
}

std::string error_in(const std::string& file) {
    const std::string text = "\n" + read_text(file);
    const std::size_t at = text.rfind("\nnarpa");
    const std::size_t says = at == std::string::npos ? at : text.find(": ", at);
    if (says == std::string::npos || text.substr(at, says - at).find_first_of(" \t") != std::string::npos)
        return last_line(file);
    const std::size_t end = text.find_last_not_of(" \t\r\n") + 1;
    return text.substr(says + 2, end - says - 2);
}

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
    const std::string said = error_in(command.err);
    return fmt::format("{} ended with {}{}", command.name, how, said.empty() ? "" : ": " + said);
}

Error Program::start_error(const std::string& what) {
    const bool ours = command.ready != ChildProcess::Ready::variable;
    const int status = child && ours ? child->status().value_or(1) : 1;
    const ErrorKind kind = status == 2   ? ErrorKind::bad_input
                           : status == 3 ? ErrorKind::missing
                                         : ErrorKind::failed;
    return {what, command.err, 0, 0, kind};
}

}  // namespace narpa::rehearsal
