#include "protocols/video/y4m.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include "drivers/descriptor.h"
#include "drivers/video/backends.h"

namespace narpa {
namespace {

constexpr int kPollPeriodMs = 20;  // between two checks of the deadline while a reader blocks or is away

// A frame with its header, and the stream's header before the first, in pieces for writev.
class Pieces {
public:
    void add(std::string_view text) noexcept { add(text.data(), text.size()); }
    void add(std::span<const std::uint8_t> bytes) noexcept { add(bytes.data(), bytes.size()); }
    [[nodiscard]] bool empty() const noexcept { return first_ == last_; }
    [[nodiscard]] ssize_t write_to(int fd) const noexcept {
        return ::writev(fd, pieces_.data() + first_, static_cast<int>(last_ - first_));
    }
    void consume(std::size_t bytes) noexcept {
        while (bytes > 0) {
            iovec& piece = pieces_[first_];
            const std::size_t part = std::min(bytes, piece.iov_len);
            piece.iov_base = static_cast<char*>(piece.iov_base) + part;
            piece.iov_len -= part;
            bytes -= part;
            if (piece.iov_len == 0) ++first_;
        }
    }

private:
    void add(const void* data, std::size_t size) noexcept { pieces_[last_++] = {const_cast<void*>(data), size}; }

    std::array<iovec, 3> pieces_{};
    std::size_t first_ = 0, last_ = 0;
};

class Y4mWriter : public VideoWriter {
public:
    Y4mWriter(const VideoFormat& format, std::string header) : format_(format), header_(std::move(header)) {
        if (!y4m_is_verbatim(format.pixel)) planar_.resize(frame_bytes(format));
    }

protected:
    std::span<const std::uint8_t> samples(std::span<const std::uint8_t> frame) noexcept {
        if (planar_.empty()) return frame;
        y4m_samples(format_, frame, planar_);
        return planar_;
    }
    [[nodiscard]] Pieces pieces(std::span<const std::uint8_t> samples_of_frame,
                                bool with_stream_header) const noexcept {
        Pieces all;
        if (with_stream_header) all.add(header_);
        all.add(kY4mFrameHeader);
        all.add(samples_of_frame);
        return all;
    }

private:
    VideoFormat format_;
    std::string header_;
    std::vector<std::uint8_t> planar_;
};

// A file always ends with a whole frame: one that a full disk cut short is removed.
class FileWriter final : public Y4mWriter {
public:
    FileWriter(Descriptor fd, const VideoFormat& format, std::string header)
        : Y4mWriter(format, std::move(header)), fd_(std::move(fd)) {}

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp&, const WriteQueue&) noexcept override {
        Pieces left = pieces(samples(frame), end_of_last_frame_ == 0);
        off_t end = end_of_last_frame_;
        while (!left.empty()) {
            const ssize_t n = left.write_to(fd_.get());
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) return take_back();
            left.consume(static_cast<std::size_t>(n));
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
        Pieces left = pieces(data, stream_header_due_);
        while (!left.empty()) {
            const ssize_t n = left.write_to(fd_.get());
            if (n > 0) {
                left.consume(static_cast<std::size_t>(n));
            } else if (n < 0 && errno == EAGAIN) {
                if (queue.time_left_ms() == 0) return Outcome::out_of_time;
                pollfd fd{fd_.get(), POLLOUT, 0};
                ::poll(&fd, 1, kPollPeriodMs);
            } else if (n == 0 || errno != EINTR) {
                return Outcome::reader_left;
            }
        }
        stream_header_due_ = false;
        return Outcome::written;
    }

    std::string path_;
    bool wait_for_reader_, had_reader_ = false, stream_header_due_ = true;
    Descriptor fd_{};
};

}  // namespace

Result<std::unique_ptr<VideoSink>> open_y4m_sink(const std::string& path, bool fifo, const VideoFormat& format,
                                                 WhenFull full) {
    Result<std::string> header = y4m_stream_header(format);
    if (!header) return Error{header.error().what, path};
    std::unique_ptr<VideoWriter> writer;
    if (fifo) {
        writer = std::make_unique<FifoWriter>(path, format, *header, full == WhenFull::wait);
    } else {
        Descriptor fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
        if (!fd) return Error{std::string("cannot write: ") + std::strerror(errno), path, 0, 0, ErrorKind::missing};
        writer = std::make_unique<FileWriter>(std::move(fd), format, *header);
    }
    return queued_sink(std::move(writer), format, full, (fifo ? "Y4M to FIFO " : "Y4M to ") + path);
}

}  // namespace narpa
