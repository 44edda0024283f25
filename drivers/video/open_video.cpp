#include <sys/stat.h>

#include <array>
#include <cstring>
#include <exception>

#include "drivers/video/backends.h"
#include "protocols/video/link_layout.h"
#include "protocols/video/y4m.h"

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

VideoSinkResult open_null_video_sink(const std::string&, const VideoSinkOptions& o) {
    return std::unique_ptr<VideoSink>(new NullSink(frame_bytes(o.format)));
}

mode_t type_of(const std::string& path) {
    struct stat info {};
    return ::stat(path.c_str(), &info) == 0 ? info.st_mode & S_IFMT : 0;
}
bool is_fifo(const std::string& text) {
    return type_of(text) == S_IFIFO;
}
bool is_y4m_file(const std::string& text) {
    return text.ends_with(".y4m") && !is_fifo(text);
}
bool is_existing_y4m_file(const std::string& text) {
    return is_y4m_file(text) && type_of(text) != 0;
}
bool is_video_device(const std::string& text) {
    return text.starts_with("/dev/video") ? !is_fifo(text) : type_of(text) == S_IFCHR && !is_y4m_file(text);
}

struct VideoSinkKind : DeviceKind {
    VideoSinkResult (*open)(const std::string& rest, const VideoSinkOptions& o);
    bool by_code = false;  ///< it states V4L2's code of a format
};
constexpr std::array kVideoSinks{
    VideoSinkKind{{"", "/dev/videoN", "/dev/videoN (V4L2 output)", is_video_device, {}, Destination::device},
                  open_v4l2_sink,
                  true},
    VideoSinkKind{{"uvc:", "uvc:PORT", "uvc:[ADDRESS:]PORT (a USB camera over USB/IP)"}, open_uvc_sink},
    VideoSinkKind{
        {"bulk:", "bulk:[BRIDGE]", "bulk:[VENDOR:PRODUCT/][SERIAL|BUS-PORT] (a USB frame bridge: FPGA, FX3)"},
        open_bulk_sink,
        true},
    VideoSinkKind{{"tcp:", "tcp:PORT", "tcp:[ADDRESS:]PORT (Y4M to each client that connects)"}, open_tcp_sink},
    VideoSinkKind{{"udp:",
                   "udp:HOST:PORT",
                   "udp:HOST[%INTERFACE]:PORT[,mtu=N][,mbit_s=N][,ttl=N] (datagrams)",
                   {},
                   {},
                   Destination::port},
                  open_udp_video_sink,
                  true},
    VideoSinkKind{{"rtp:",
                   "rtp:HOST:PORT",
                   "rtp:HOST[%INTERFACE]:PORT[,sdp=FILE][,mtu=N][,mbit_s=N][,ttl=N] (RTP, RFC 4175)",
                   {},
                   {},
                   Destination::port},
                  open_rtp_sink},
    VideoSinkKind{{"gige:", "gige:[ADDRESS]", "gige:[ADDRESS] (a GigE Vision camera)", {}, {}, Destination::port},
                  open_gige_sink},
    VideoSinkKind{{"", "FILE.y4m", "FILE.y4m", is_y4m_file, {}, Destination::new_file}, open_y4m_file},
    VideoSinkKind{{"", "an existing FIFO", "a FIFO (Y4M)", is_fifo, {}, Destination::device}, open_y4m_fifo},
    VideoSinkKind{{"", "none", "none", is_none}, open_null_video_sink},
};
constexpr std::span<const VideoSinkKind> kVideoSinkTable{kVideoSinks};

struct VideoSourceKind : DeviceKind {
    VideoSourceResult (*open)(const std::string& rest, const VideoFormat& format);
    bool by_code = false;      ///< frames have V4L2's code of their format
    bool has_samples = false;  ///< frames of samples; else as the link lays them out
};
constexpr std::array kVideoSources{
    VideoSourceKind{{"", "/dev/videoN", "/dev/videoN (V4L2 capture)", is_video_device}, open_v4l2_source, true},
    VideoSourceKind{{"bridge:", "bridge:PORT", "bridge:[ADDRESS:]PORT (a USB frame bridge in software)"},
                    open_bridge_source,
                    true},
    VideoSourceKind{
        {"udp:", "udp:PORT", "udp:[ADDRESS[%INTERFACE]:]PORT (datagrams)"}, open_udp_video_source, true},
    VideoSourceKind{
        {"rtp:", "rtp:PORT", "rtp:[ADDRESS[%INTERFACE]:]PORT (RTP, RFC 4175)"}, open_rtp_source, false, true},
    VideoSourceKind{{"", "FILE.y4m", "FILE.y4m (followed as it grows)", is_existing_y4m_file}, open_y4m_source},
    VideoSourceKind{{"", "an existing FIFO", "a FIFO (Y4M)", is_fifo}, open_y4m_source},
};
constexpr std::span<const VideoSourceKind> kVideoSourceTable{kVideoSources};

/// Frames of samples from those of a link.
class SamplesOfLink final : public VideoSource {
public:
    SamplesOfLink(std::unique_ptr<VideoSource> link, const VideoFormat& format)
        : link_(std::move(link)), format_(format), laid_out_(link_bytes(format)) {}
    bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) override {
        const bool received = link_->receive(laid_out_, timeout_ns);
        if (received) samples_of_link(format_, laid_out_, frame);
        status_ = link_->status();
        counters_ = link_->counters();
        return received;
    }
    std::string description() const override { return link_->description(); }

private:
    std::unique_ptr<VideoSource> link_;
    VideoFormat format_;
    std::vector<std::uint8_t> laid_out_;
};

std::string unfit(const VideoFormat& format) {
    const std::string what = unfit_size(format.pixel, format.width, format.height);
    return what.empty() ? unfit_layout(format.pixel, format.link, format.width) : what;
}

std::string no_code(const VideoFormat& format) {
    return "V4L2 has no code of " + link_text(format.pixel, format.link) +
           "; expected another format of the camera in the scene, or gige:, which has one";
}

Error no_such_path(const std::string& spec) {
    Error error{"video source \"" + spec + "\": no such file or device", {}, 0, 0, ErrorKind::missing};
    if (!spec.starts_with("/dev/"))
        error.remedy = "mkfifo " + spec + "   (then narpa run --video CAMERA=" + spec + ")";
    return error;
}

}  // namespace

void VideoWriter::write(std::span<const std::uint8_t> item, const WriteQueue& queue) noexcept {
    FrameStamp stamp;
    std::memcpy(&stamp, item.data(), sizeof stamp);
    const auto samples = item.subspan(sizeof stamp);
    if (laid_out_.empty()) return write_frame(samples, stamp, queue);
    lay_out(format_, samples, laid_out_);
    write_frame(laid_out_, stamp, queue);
}

std::unique_ptr<VideoSink> queued_sink(std::unique_ptr<VideoWriter> writer, const VideoFormat& format,
                                       WhenFull full, std::string description) {
    writer->format_ = format;
    if (!format.link.is_samples()) writer->laid_out_.resize(link_bytes(format));
    return std::make_unique<QueuedSink>(std::move(writer), format, full, std::move(description));
}

const DeviceKind* video_sink_kind(const std::string& spec) {
    return find_kind(kVideoSinkTable, spec);
}
Status check_video_file(const std::string& path, const VideoFormat& format) {
    if (auto header = y4m_stream_header(format); !header) return Error{header.error().what, path};
    return check_writable(path);
}
std::string video_sink_help() {
    return help_of(kVideoSinkTable);
}
std::string video_source_help() {
    return help_of(kVideoSourceTable);
}

VideoSinkResult open_video_sink(std::string_view spec, const VideoFormat& format, WhenFull full,
                                const std::optional<VideoControls>& controls) {
    if (format.width <= 0 || format.height <= 0 || format.period_ns <= 0)
        return Error{"video: width, height and frame period must be positive"};
    if (const std::string what = unfit(format); !what.empty()) return Error{"video: " + what};
    const std::string text(spec), name = "video sink \"" + text + "\": ";
    const VideoSinkKind* kind = find_kind(kVideoSinkTable, text);
    if (kind == nullptr) return Error{name + "expected " + forms_of(kVideoSinkTable)};
    if (kind->by_code && link_code(format.pixel, format.link).empty()) return Error{name + no_code(format)};
    try {
        return kind->open(kind->rest_of(text), {format, full, controls});
    } catch (const std::exception& e) {  // no memory, no thread, no descriptor left
        return Error{name + e.what(), {}, 0, 0, ErrorKind::missing};
    }
}

VideoSourceResult open_video_source(std::string_view spec, const VideoFormat& format) {
    if (format.width <= 0 || format.height <= 0) return Error{"video: width and height must be positive"};
    if (const std::string what = unfit(format); !what.empty()) return Error{"video: " + what};
    const std::string text(spec), name = "video source \"" + text + "\": ";
    const VideoSourceKind* kind = find_kind(kVideoSourceTable, text);
    if (kind == nullptr && type_of(text) == 0 && !text.empty()) return no_such_path(text);
    if (kind == nullptr) return Error{name + "expected " + forms_of(kVideoSourceTable)};
    if (kind->by_code && link_code(format.pixel, format.link).empty()) return Error{name + no_code(format)};
    try {
        auto source = kind->open(kind->rest_of(text), format);
        if (!source || kind->has_samples || format.link.is_samples()) return source;
        return std::unique_ptr<VideoSource>(std::make_unique<SamplesOfLink>(*std::move(source), format));
    } catch (const std::exception& e) {  // no memory
        return Error{name + e.what(), {}, 0, 0, ErrorKind::missing};
    }
}

}  // namespace narpa
