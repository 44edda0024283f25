// A candump log as a bus: a hub reads it, a client writes it.
#include <fcntl.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/text_lines.h"
#include "drivers/can/buses.h"
#include "drivers/descriptor.h"
#include "protocols/can/candump.h"

namespace narpa {
namespace {

/// All frames can be read at once, with their time since the first line; a real-time run paces them itself.
class CandumpReader final : public CanBus {
public:
    CandumpReader(std::vector<ReceivedFrame> frames, std::uint64_t error_frames, std::string path)
        : frames_(std::move(frames)), path_(std::move(path)) {
        counters_.error_frames = error_frames;
    }

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        if (ended()) return false;
        out = frames_[next_++];
        ++counters_.received;
        return true;
    }
    /// A log that is read takes no frames.
    bool send(const CanFrame&) noexcept override {
        ++counters_.send_drops;
        return false;
    }
    /// At the end of the log only the timeout passes, and -1 returns at once.
    void wait(std::int64_t timeout_ns) noexcept override {
        if (ended() && timeout_ns > 0) wait_ready({}, timeout_ns);
    }
    [[nodiscard]] bool ended() const noexcept override { return next_ == frames_.size(); }
    [[nodiscard]] bool recorded() const noexcept override { return true; }
    [[nodiscard]] bool carries_fd() const noexcept override { return true; }
    [[nodiscard]] std::string description() const override {
        return "log: " + path_ + " (" + std::to_string(frames_.size()) + " frames)";
    }

private:
    std::vector<ReceivedFrame> frames_;
    std::string path_;
    std::size_t next_ = 0;
};

class CandumpWriter final : public CanBus {
public:
    CandumpWriter(Descriptor fd, std::string path) : fd_(std::move(fd)), path_(std::move(path)) {}

    /// A log that is written has no frames to read.
    [[nodiscard]] bool receive(ReceivedFrame&) noexcept override { return false; }
    bool send(const CanFrame& frame) noexcept override {
        bool written = false;
        if (sendable(frame)) {
            CandumpLine line{t_open_unix_ns_ + monotonic_ns() - t_open_ns_, frame};
            if (frame.fd) line.frame.size = fd_length(frame.size);
            std::array<char, kCandumpMaxLine> text;
            const std::size_t n = format_candump(line, "narpa", text);
            written = ::write(fd_.get(), text.data(), n) == static_cast<ssize_t>(n);
        }
        ++(written ? counters_.sent : counters_.send_drops);
        return written;
    }
    void wait(std::int64_t timeout_ns) noexcept override {
        if (timeout_ns > 0) wait_ready({}, timeout_ns);
    }
    [[nodiscard]] bool ended() const noexcept override { return true; }
    [[nodiscard]] bool carries_fd() const noexcept override { return true; }
    [[nodiscard]] std::string description() const override { return "log: " + path_ + " (written)"; }

private:
    Descriptor fd_;
    std::string path_;
    std::int64_t t_open_ns_ = monotonic_ns(), t_open_unix_ns_ = clock_ns(CLOCK_REALTIME);
};

Error cannot(const char* what, const std::string& path, int reason) {
    const ErrorKind kind = reason == EACCES || reason == EPERM ? ErrorKind::missing : ErrorKind::bad_input;
    return {.what = std::string("cannot ") + what + " the CAN log: " + std::strerror(reason),
            .file = path,
            .kind = kind};
}

CanBusResult open_reader(const std::string& path) {
    std::ifstream file(path);
    if (!file) return cannot("open", path, errno);
    std::vector<ReceivedFrame> frames;
    TextLines lines(file);
    std::string_view text;
    std::int64_t t_first_ns = 0;
    std::uint64_t error_frames = 0;
    bool any = false;
    while (lines.next(text)) {
        if (text.find_first_not_of(" \t") == std::string_view::npos) continue;
        CandumpLine line;
        if (const char* expected = parse_candump(text, line)) return Error{expected, path, lines.number()};
        if (!any) t_first_ns = line.t_ns;
        any = true;
        if (line.frame.error)
            ++error_frames;
        else
            frames.push_back({line.frame, line.t_ns - t_first_ns});
    }
    if (file.bad()) return cannot("read", path, EIO);
    return CanBusResult(std::make_unique<CandumpReader>(std::move(frames), error_frames, path));
}

CanBusResult open_writer(const std::string& path) {
    Descriptor fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (!fd) return cannot("write", path, errno);
    return CanBusResult(std::make_unique<CandumpWriter>(std::move(fd), path));
}

}  // namespace

CanBusResult open_candump(const std::string& path, CanRole role) {
    if (path.empty()) return Error{"log: expected the name of a candump log, such as log:run.log"};
    return role == CanRole::hub ? open_reader(path) : open_writer(path);
}

}  // namespace narpa
