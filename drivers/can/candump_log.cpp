// A candump log as a bus: a hub reads it, a client writes it.
#include <fcntl.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/text/text_lines.h"
#include "drivers/can/buses.h"
#include "drivers/descriptor.h"
#include "protocols/can/candump.h"

namespace narpa {
namespace {

/// All frames can be read at once, with their time since the first line; a real-time run paces them itself.
class CandumpReader final : public CanBus {
public:
    CandumpReader(std::vector<ReceivedFrame> frames, const CanCounters& left_out, std::string description)
        : frames_(std::move(frames)), description_(std::move(description)) {
        counters_ = left_out;
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
    [[nodiscard]] std::string description() const override { return description_; }

private:
    std::vector<ReceivedFrame> frames_;
    std::string description_;
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

/// The frames of a log's lines, of one interface.
class LogFrames {
public:
    /// `interface`: empty takes all lines, which must then be of one interface.
    explicit LogFrames(std::string interface) : wanted_(std::move(interface)) {}

    Status read(std::istream& file, const std::string& path) {
        TextLines lines(file);
        std::string_view text;
        while (lines.next(text)) {
            if (text.find_first_not_of(" \t") == text.npos) continue;
            CandumpLine line;
            if (const char* expected = parse_candump(text, line)) {
                if (lines.may_be_cut() && any_line_) {
                    cut_off_ = true;
                    ++left_out.malformed;
                    break;
                }
                const std::string_view remedy = any_line_ ? "" : remedy_for_log(text);
                return Error{remedy.empty() ? std::string(expected) : std::string(remedy), path, lines.number()};
            }
            if (Status taken = take(line, path, lines.number()); !taken) return taken;
        }
        if (!wanted_.empty() && !any_wanted_ && any_line_)
            return Error{"it has no frame of " + wanted_ + ", but of " + first_, path};
        return Ok{};
    }
    [[nodiscard]] std::string description(const std::string& path) const {
        return "log: " + path + " (" + std::to_string(frames.size()) + " frames" +
               (wanted_.empty() ? "" : " of " + wanted_) +
               (cut_off_ ? "; its last line is cut off and left out" : "") + ")";
    }

    std::vector<ReceivedFrame> frames;
    CanCounters left_out{};

private:
    Status take(const CandumpLine& line, const std::string& path, int number) {
        if (!std::exchange(any_line_, true)) t_first_ns_ = line.t_ns, first_ = line.interface;
        if (!wanted_.empty() && line.interface != wanted_) return Ok{};
        any_wanted_ = true;
        if (line.is_xl) return ++left_out.not_carried, Ok{};
        if (line.frame.error) return ++left_out.error_frames, Ok{};
        if (used_.empty()) used_ = line.interface;
        if (line.interface != used_)
            return Error{"frames of " + std::string(line.interface) + " after those of " + used_ +
                             ", expected those of one bus: log:" + path + ":" + used_ + " or log:" + path + ":" +
                             std::string(line.interface),
                         path, number};
        frames.push_back({line.frame, line.t_ns - t_first_ns_});
        return Ok{};
    }

    std::string wanted_, first_, used_;
    std::int64_t t_first_ns_ = 0;
    bool any_line_ = false, any_wanted_ = false, cut_off_ = false;
};

/// FILE, or FILE:INTERFACE where there is no file of the whole name.
CanBusResult open_reader(const std::string& name) {
    std::string path = name, interface;
    if (const std::size_t colon = name.rfind(':'); colon != name.npos && !std::filesystem::exists(name))
        path = name.substr(0, colon), interface = name.substr(colon + 1);
    std::ifstream file(path);
    if (!file) return cannot("open", path, errno);
    LogFrames log(interface);
    if (const Status read = log.read(file, path); !read) return read.error();
    if (file.bad()) return cannot("read", path, EIO);
    const std::string description = log.description(path);
    return CanBusResult(std::make_unique<CandumpReader>(std::move(log.frames), log.left_out, description));
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
