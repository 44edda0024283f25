#include <sys/stat.h>

#include <array>
#include <cstring>
#include <exception>

#include "drivers/video/backends.h"

namespace narpa {
namespace {

constexpr std::size_t kSlots = 8;  // 0.8 s at 10 Hz: a disk may pause

class QueuedSink final : public VideoSink {
public:
    QueuedSink(std::unique_ptr<VideoWriter> writer, const VideoFormat& format, WhenFull full,
               std::string description)
        : writer_(std::move(writer)),
          frame_size_(frame_bytes(format)),
          description_(std::move(description)),
          queue_(*writer_, kSlots, sizeof(FrameStamp) + frame_size_, full == WhenFull::wait) {}

    bool send(std::span<const std::uint8_t> frame, const FrameStamp& stamp) noexcept override {
        std::array<std::uint8_t, sizeof stamp> head;
        std::memcpy(head.data(), &stamp, sizeof stamp);
        if (frame.size() == frame_size_) return queue_.push(head, frame);
        ++writer_->failed;
        return false;
    }
    void flush() noexcept override { queue_.flush(); }
    VideoCounters counters() const noexcept override {
        return {writer_->written, queue_.dropped(), writer_->no_reader, writer_->failed, writer_->reconnects};
    }
    std::string description() const override { return description_; }
    bool next_request(VideoRequest& request) noexcept override { return writer_->next_request(request); }
    Status failure() const override {
        const int reason = writer_->file_error;
        if (reason == 0) return Ok{};
        return Error{description_ + ": " + std::to_string(writer_->failed) +
                         " frames could not be written: " + std::strerror(reason),
                     {},
                     0,
                     0,
                     ErrorKind::failed};
    }

private:
    std::unique_ptr<VideoWriter> writer_;
    std::size_t frame_size_;
    std::string description_;
    WriteQueue queue_;
};

class NullSink final : public VideoSink {
public:
    explicit NullSink(std::size_t frame_size) : frame_size_(frame_size) {}
    bool send(std::span<const std::uint8_t> frame, const FrameStamp& /*stamp*/) noexcept override {
        const bool whole = frame.size() == frame_size_;
        ++(whole ? written_ : failed_);
        return whole;
    }
    void flush() noexcept override {}
    VideoCounters counters() const noexcept override { return {.written = written_, .failed = failed_}; }
    std::string description() const override { return "none (frames are counted and thrown away)"; }

private:
    std::size_t frame_size_;
    std::atomic<std::uint64_t> written_{0}, failed_{0};
};

Result<std::unique_ptr<VideoSink>> open_by_kind(const std::string& spec, const VideoFormat& format, WhenFull full,
                                                const std::optional<VideoControls>& controls) {
    constexpr std::string_view kUvc = "uvc:", kBulk = "bulk:";
    if (spec.starts_with(kUvc))
        return open_uvc_sink(std::string_view(spec).substr(kUvc.size()), format, full, controls);
    if (spec.starts_with(kBulk)) return open_bulk_sink(std::string_view(spec).substr(kBulk.size()), format, full);
    if (spec == "none") return std::unique_ptr<VideoSink>(new NullSink(frame_bytes(format)));
    struct stat info {};
    const bool exists = ::stat(spec.c_str(), &info) == 0;
    if (exists && S_ISFIFO(info.st_mode)) return open_y4m_sink(spec, true, format, full);
    if (spec.ends_with(".y4m")) return open_y4m_sink(spec, false, format, full);
    if (spec.starts_with("/dev/video") || (exists && S_ISCHR(info.st_mode)))
        return open_v4l2_sink(spec, format, full);
    return Error{"video sink \"" + spec +
                 "\": expected /dev/videoN, uvc:PORT, bulk:[BRIDGE], FILE.y4m, an existing FIFO, or none"};
}

Error no_such_path(const std::string& spec) {
    Error error{"video source \"" + spec + "\": no such file or device", {}, 0, 0, ErrorKind::missing};
    if (!spec.starts_with("/dev/"))
        error.remedy = "mkfifo " + spec + "   (then narpa run --video CAMERA=" + spec + ")";
    return error;
}

Result<std::unique_ptr<VideoSource>> open_by_kind(const std::string& spec, const VideoFormat& format) {
    constexpr std::string_view kBridge = "bridge:";
    if (spec.starts_with(kBridge)) return open_bridge_source(std::string_view(spec).substr(kBridge.size()), format);
    struct stat info {};
    const bool exists = ::stat(spec.c_str(), &info) == 0;
    if (spec.starts_with("/dev/video") || (exists && S_ISCHR(info.st_mode))) return open_v4l2_source(spec, format);
    if (exists && (S_ISFIFO(info.st_mode) || spec.ends_with(".y4m"))) return open_y4m_source(spec, format);
    if (!exists && !spec.empty()) return no_such_path(spec);
    return Error{"video source \"" + spec + "\": expected /dev/videoN, bridge:PORT, FILE.y4m, or an existing FIFO"};
}

}  // namespace

void VideoWriter::write(std::span<const std::uint8_t> item, const WriteQueue& queue) noexcept {
    FrameStamp stamp;
    std::memcpy(&stamp, item.data(), sizeof stamp);
    write_frame(item.subspan(sizeof stamp), stamp, queue);
}

std::unique_ptr<VideoSink> queued_sink(std::unique_ptr<VideoWriter> writer, const VideoFormat& format,
                                       WhenFull full, std::string description) {
    return std::make_unique<QueuedSink>(std::move(writer), format, full, std::move(description));
}

Result<std::unique_ptr<VideoSink>> open_video_sink(std::string_view spec, const VideoFormat& format, WhenFull full,
                                                   const std::optional<VideoControls>& controls) {
    if (format.width <= 0 || format.height <= 0 || format.period_ns <= 0)
        return Error{"video: width, height and frame period must be positive"};
    if (const std::string what = unfit_size(format.pixel, format.width, format.height); !what.empty())
        return Error{"video: " + what};
    try {
        return open_by_kind(std::string(spec), format, full, controls);
    } catch (const std::exception& e) {  // no memory, no thread, no descriptor left
        return Error{"video sink \"" + std::string(spec) + "\": " + e.what(), {}, 0, 0, ErrorKind::missing};
    }
}

Result<std::unique_ptr<VideoSource>> open_video_source(std::string_view spec, const VideoFormat& format) {
    if (format.width <= 0 || format.height <= 0) return Error{"video: width and height must be positive"};
    try {
        return open_by_kind(std::string(spec), format);
    } catch (const std::exception& e) {  // no memory
        return Error{"video source \"" + std::string(spec) + "\": " + e.what(), {}, 0, 0, ErrorKind::missing};
    }
}

}  // namespace narpa
