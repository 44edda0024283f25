/// renderer/scene/reader_process.h - a program of ours that reads a file of others within limits of memory and time
/// and writes what it found to a pipe: a damaged file may crash it, and nothing else.
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

    /// Starts the program, which is beside the running one or on PATH. 0, or the errno of why it cannot be started.
    int start(const std::string& program, std::vector<std::string> arguments);
    /// Ends it; its wait status. One that had closed its pipe by ending keeps the status that it ended with.
    int end();
    [[nodiscard]] int output() const { return out_; }

private:
    pid_t pid_ = -1;
    int out_ = -1, status_ = 0;
};

/// Bytes of a pipe, until a time and up to a number.
class PipeReceiver {
public:
    static constexpr bool kReceives = true;

    PipeReceiver(int fd, std::uint64_t most_bytes, int seconds)
        : fd_(fd), left_(most_bytes), deadline_(Clock::now() + std::chrono::seconds(seconds)) {}

    bool bytes(void* data, std::size_t size);
    [[nodiscard]] bool timed_out() const { return timed_out_; }

private:
    using Clock = std::chrono::steady_clock;

    bool wait();

    int fd_;
    std::uint64_t left_;
    Clock::time_point deadline_;
    bool timed_out_ = false;
};

/// What ended a process that had not sent all: "the mesh reader crashed (signal 11)". `reader` as here.
[[nodiscard]] std::string why_it_ended(const std::string& reader, int status, std::uint64_t memory_bytes);

}  // namespace narpa
