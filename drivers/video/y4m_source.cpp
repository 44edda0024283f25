// Frames from a Y4M stream: a FIFO whose writers may open and close, or a file that may still grow.
#include <fcntl.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include "drivers/descriptor.h"
#include "drivers/video/backends.h"
#include "protocols/video/y4m.h"

namespace narpa {
namespace {

constexpr std::size_t kLongestLine = 256;
constexpr int kPipeBytes = 1 << 20;  // an unprivileged process may have this: a frame goes in at once
constexpr std::int64_t kWriterPollPeriod_ns =
    1'000'000;  // between two checks for a writer, which poll() does not report

class Y4mSource final : public VideoSource {
public:
    Y4mSource(Descriptor fd, bool fifo, std::string path, const VideoFormat& format)
        : fd_(std::move(fd)), fifo_(fifo), path_(std::move(path)), format_(format), samples_(frame_bytes(format)) {}

    [[nodiscard]] bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) override {
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        while (status_) {
            const Progress progress = advance();
            if (progress == Progress::frame) {
                frame_from_y4m(format_, samples_, frame);
                ++counters_.received;
                return true;
            }
            if (progress == Progress::going_on) continue;
            const std::int64_t left_ns = until_ns - monotonic_ns();
            if (left_ns <= 0) return false;
            if (progress == Progress::end) {
                wait_ready({}, std::min(left_ns, kWriterPollPeriod_ns));
            } else {
                std::array<pollfd, 1> fds{{{fd_.get(), POLLIN, 0}}};
                wait_ready(fds, left_ns);
            }
        }
        return false;
    }

    [[nodiscard]] std::string description() const override {
        return (fifo_ ? "Y4M from FIFO " : "Y4M from ") + path_;
    }

private:
    enum class Part : std::uint8_t { stream_header, frame_header, samples };
    enum class Progress : std::uint8_t { frame, going_on, nothing, end };

    /// Calls read() once and processes the bytes.
    Progress advance() {
        if (part_ == Part::samples) {
            const Progress progress = read_into({samples_.data() + filled_, samples_.size() - filled_});
            if (progress != Progress::going_on || filled_ < samples_.size()) return progress;
            begin(Part::frame_header);
            return Progress::frame;
        }
        // One byte at a time, so that none of what follows the line is taken with it.
        const Progress progress = read_into({line_.data() + filled_, 1});
        if (progress != Progress::going_on) return progress;
        if (line_[filled_ - 1] == '\n')
            take_line({reinterpret_cast<const char*>(line_.data()), filled_ - 1});
        else if (filled_ == line_.size())
            fail({"not a Y4M stream: a line of more than " + std::to_string(kLongestLine) + " bytes"});
        return Progress::going_on;
    }

    Progress read_into(std::span<std::uint8_t> room) {
        ssize_t n = 0;
        do {
            n = ::read(fd_.get(), room.data(), room.size());
        } while (n < 0 && errno == EINTR);
        if (n > 0) {
            filled_ += static_cast<std::size_t>(n);
            return Progress::going_on;
        }
        if (n < 0 && errno != EAGAIN) fail({std::string("cannot read: ") + std::strerror(errno)});
        if (n < 0) return Progress::nothing;
        if (fifo_) writer_left();
        return Progress::end;
    }

    void take_line(std::string_view line) {
        // A writer may have closed and another opened between two checks.
        if (part_ == Part::stream_header || line.starts_with("YUV4MPEG2 ")) {
            const Status status = check_y4m_stream_header(line, format_);
            if (!status) return fail(status.error());
            return begin(Part::frame_header);
        }
        if (line != "FRAME" && !line.starts_with("FRAME "))
            return fail({"not a Y4M stream: FRAME expected, \"" + std::string(line.substr(0, 16)) + "\" found"});
        begin(Part::samples);
    }

    /// The next writer begins with a stream header; an unfinished frame of this one is dropped and counted.
    void writer_left() noexcept {
        if (part_ == Part::samples || (part_ == Part::frame_header && filled_ > 0)) ++counters_.truncated;
        begin(Part::stream_header);
    }

    void begin(Part part) noexcept {
        part_ = part;
        filled_ = 0;
    }
    void fail(Error error) {
        error.file = path_;
        status_ = std::move(error);
    }

    Descriptor fd_;
    bool fifo_;
    std::string path_;
    VideoFormat format_;
    std::vector<std::uint8_t> samples_;
    std::array<std::uint8_t, kLongestLine> line_{};
    Part part_ = Part::stream_header;
    std::size_t filled_ = 0;  ///< bytes of the part
};

}  // namespace

VideoSourceResult open_y4m_source(const std::string& path, const VideoFormat& format) {
    const Result<std::string> header = y4m_stream_header(format);
    if (!header) return Error{header.error().what, path};
    // O_NONBLOCK: a FIFO opens without a writer.
    Descriptor fd(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    struct stat info {};
    if (!fd || ::fstat(fd.get(), &info) != 0)
        return Error{std::string("cannot read: ") + std::strerror(errno), path, 0, 0, ErrorKind::missing};
    const bool fifo = S_ISFIFO(info.st_mode);
    if (fifo) ::fcntl(fd.get(), F_SETPIPE_SZ, kPipeBytes);  // best effort: with less, a writer waits for us
    return std::unique_ptr<VideoSource>(std::make_unique<Y4mSource>(std::move(fd), fifo, path, format));
}

}  // namespace narpa
