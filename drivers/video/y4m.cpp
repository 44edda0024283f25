#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>

#include "drivers/descriptor.h"
#include "drivers/video/y4m_writer.h"

namespace narpa {
namespace {

// A file always ends with a whole frame: one that a full disk cut short is removed.
class FileWriter final : public Y4mWriter {
public:
    FileWriter(Descriptor fd, const VideoFormat& format, std::string header)
        : Y4mWriter(format, std::move(header)), fd_(std::move(fd)) {}

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp&, const WriteQueue&) noexcept override {
        Y4mPieces left = pieces(samples(frame), end_of_last_frame_ == 0);
        off_t end = end_of_last_frame_;
        while (!left.empty()) {
            const ssize_t n = left.write_to(fd_.get());
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) return take_back();
            end += n;
        }
        end_of_last_frame_ = end;
        ++written;
    }

private:
    void take_back() noexcept {
        file_error = errno;
        ++failed;
        if (::ftruncate(fd_.get(), end_of_last_frame_) == 0) ::lseek(fd_.get(), end_of_last_frame_, SEEK_SET);
    }

    Descriptor fd_;
    off_t end_of_last_frame_ = 0;
};

// Every reader gets a header and whole frames. The pipe keeps what a reader left unread for as long as one end is
// open, so our end closes as soon as the reader is gone, before the next one can find half a frame.
class FifoWriter final : public Y4mWriter {
public:
    FifoWriter(std::string path, const VideoFormat& format, std::string header, bool wait_for_reader)
        : Y4mWriter(format, std::move(header)), path_(std::move(path)), wait_for_reader_(wait_for_reader) {}

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp&,
                     const WriteQueue& queue) noexcept override {
        const std::span<const std::uint8_t> data = samples(frame);
        for (;;) {
            if (!reach_reader(queue)) return void(++no_reader);
            switch (write_to_reader(data, queue)) {
                case Outcome::written: return void(++written);
                case Outcome::out_of_time:
                    lost();  // what follows would continue half a frame
                    return void(++failed);
                case Outcome::reader_left:
                    lost();
                    if (!wait_for_reader_) return void(++no_reader);
            }
        }
    }
    void abandon(std::span<const std::uint8_t>) noexcept override { ++(fd_ ? failed : no_reader); }
    int watched() const noexcept override { return fd_.get(); }
    void lost() noexcept override { fd_.reset(); }

private:
    enum class Outcome { written, reader_left, out_of_time };

    // A FIFO opens for writing without blocking only while somebody reads it.
    bool reach_reader(const WriteQueue& queue) noexcept {
        while (!fd_) {
            fd_ = Descriptor(::open(path_.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC));
            if (fd_) {
                stream_header_due_ = true;
                if (had_reader_) ++reconnects;
                had_reader_ = true;
            } else if (!wait_for_reader_ || queue.time_left_ms() == 0) {
                return false;
            } else {
                ::poll(nullptr, 0, kPollPeriodMs);
            }
        }
        return true;
    }

    Outcome write_to_reader(std::span<const std::uint8_t> data, const WriteQueue& queue) noexcept {
        Y4mPieces left = pieces(data, stream_header_due_);
        while (!left.empty()) {
            const ssize_t n = left.write_to(fd_.get());
            if (n > 0 || (n < 0 && errno == EINTR)) continue;
            if (n == 0 || errno != EAGAIN) return Outcome::reader_left;
            if (queue.time_left_ms() == 0) return Outcome::out_of_time;
            pollfd fd{fd_.get(), POLLOUT, 0};
            ::poll(&fd, 1, kPollPeriodMs);
        }
        stream_header_due_ = false;
        return Outcome::written;
    }

    std::string path_;
    bool wait_for_reader_, had_reader_ = false, stream_header_due_ = true;
    Descriptor fd_{};
};

}  // namespace

VideoSinkResult open_y4m_file(const std::string& path, const VideoSinkOptions& o) {
    Result<std::string> header = y4m_stream_header(o.format);
    if (!header) return Error{header.error().what, path};
    Descriptor fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (!fd) return Error{std::string("cannot write: ") + std::strerror(errno), path, 0, 0, ErrorKind::missing};
    return queued_sink(std::make_unique<FileWriter>(std::move(fd), o.format, *header), o.format, o.full,
                       "Y4M to " + path);
}

VideoSinkResult open_y4m_fifo(const std::string& path, const VideoSinkOptions& o) {
    Result<std::string> header = y4m_stream_header(o.format);
    if (!header) return Error{header.error().what, path};
    return queued_sink(std::make_unique<FifoWriter>(path, o.format, *header, o.full == WhenFull::wait), o.format,
                       o.full, "Y4M to FIFO " + path);
}

}  // namespace narpa
