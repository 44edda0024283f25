/// renderer/assets/reader_process.h - runs a narpa program that reads an untrusted file within limits of memory and
/// time and writes the result to a pipe: a damaged file can crash only that process.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace narpa {

/// The process, and the end of the pipe that it writes to.
class ReaderProcess {
public:
    ReaderProcess() = default;
    ReaderProcess(const ReaderProcess&) = delete;
    ReaderProcess& operator=(const ReaderProcess&) = delete;
    ~ReaderProcess();

    /// Starts the program, which is beside the running one or on PATH. Returns 0, or an errno if it cannot be
    /// started.
    int start(const std::string& program, std::vector<std::string> arguments);
    /// Kills the process and returns its wait status. A process that has already exited keeps its own status.
    int end();
    [[nodiscard]] int output() const { return out_; }

private:
    pid_t pid_ = -1;
    int out_ = -1, status_ = 0;
};

/// Reads bytes of a pipe, until a deadline and up to a limit.
class PipeReceiver {
public:
    static constexpr bool kReceives = true;

    PipeReceiver(int fd, std::uint64_t max_bytes, int seconds)
        : fd_(fd), left_(max_bytes), deadline_(Clock::now() + std::chrono::seconds(seconds)) {}

    bool bytes(void* data, std::size_t size);
    /// Bytes that may still come.
    [[nodiscard]] std::uint64_t left() const { return left_; }
    [[nodiscard]] bool timed_out() const { return timed_out_; }

private:
    using Clock = std::chrono::steady_clock;

    bool wait();

    int fd_;
    std::uint64_t left_;
    Clock::time_point deadline_;
    bool timed_out_ = false;
};

/// Why a process ended before it had sent everything: "the mesh reader crashed (signal 11)". `reader`: "the mesh
/// reader".
[[nodiscard]] std::string why_it_ended(const std::string& reader, int status, std::uint64_t memory_bytes);

}  // namespace narpa
