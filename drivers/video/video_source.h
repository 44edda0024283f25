/// drivers/video/video_source.h - where frames come from: a V4L2 capture device, a Y4M FIFO or file.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/pixel_format.h"
#include "base/result.h"

namespace narpa {

struct VideoSourceCounters {
    std::uint64_t received = 0;   ///< whole frames handed out
    std::uint64_t truncated = 0;  ///< thrown away: the writer left in the middle, or the device gave too few bytes
    std::uint64_t lost = 0;       ///< the device skipped them (by its own count): nobody took them in time
};

/// Frames in the order of their coming, none of them twice, none torn. Whoever writes may come later, go, and come
/// again: a FIFO's next writer begins a stream of its own. A FIFO holds its writer up rather than lose a frame; of
/// frames that nobody takes, v4l2loopback (0.12) keeps two and then only the newest.
class VideoSource {
public:
    virtual ~VideoSource() = default;

    /// Waits for the next whole frame, at most `timeout_ns` (0: takes what is there), and writes it into `frame`
    /// (frame_bytes of the format). False: nothing in time, or `status` has an error.
    [[nodiscard]] virtual bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) = 0;
    /// An error when no frame will ever come: the stream has another format than was asked for, or is no video.
    [[nodiscard]] const Status& status() const noexcept { return status_; }
    [[nodiscard]] const VideoSourceCounters& counters() const noexcept { return counters_; }
    [[nodiscard]] virtual std::string description() const = 0;

protected:
    Status status_{Ok{}};
    VideoSourceCounters counters_{};
};

/// SOURCE: `/dev/videoN` (V4L2 capture) | an existing FIFO or `FILE.y4m` (Y4M, as the sink writes it; a file is
/// followed as it grows). Does not wait for a writer: what cannot be known before one comes, `status` tells later.
Result<std::unique_ptr<VideoSource>> open_video_source(std::string_view spec, const VideoFormat& format);

}  // namespace narpa
