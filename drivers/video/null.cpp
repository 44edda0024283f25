#include <atomic>

#include "drivers/video/backends.h"

namespace narpa {
namespace {

class NullVideoSink final : public VideoSink {
public:
    explicit NullVideoSink(std::size_t frame_size) : frame_size_(frame_size) {}
    bool send(std::span<const std::uint8_t> frame) noexcept override {
        const bool whole = frame.size() == frame_size_;
        (whole ? written_ : failed_).fetch_add(1, std::memory_order_relaxed);
        return whole;
    }
    void flush() noexcept override {}
    VideoCounters counters() const noexcept override {
        VideoCounters c;
        c.written = written_.load(std::memory_order_relaxed);
        c.failed = failed_.load(std::memory_order_relaxed);
        return c;
    }
    std::string description() const override { return "none (frames are counted and thrown away)"; }

private:
    std::size_t frame_size_;
    std::atomic<std::uint64_t> written_{0}, failed_{0};
};

}  // namespace

Result<std::unique_ptr<VideoSink>> open_null_sink(const VideoFormat& format) {
    return std::unique_ptr<VideoSink>(std::make_unique<NullVideoSink>(frame_bytes(format)));
}

}  // namespace narpa
