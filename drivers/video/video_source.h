/// drivers/video/video_source.h - source of frames: a V4L2 capture device, a USB frame bridge, UDP datagrams, RTP
/// packets, a Y4M FIFO or file.
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
    std::uint64_t truncated = 0;  ///< dropped: the writer closed within a frame, the device returned too few bytes,
                                  ///< or datagrams were lost
    std::uint64_t lost = 0;       ///< gaps in the device's sequence numbers: the frames were not read in time
};

/// Whole frames in the order of arrival, none twice. A writer may open later, close, and open again: a FIFO's next
/// writer begins a new stream. A FIFO blocks its writer rather than lose a frame; v4l2loopback (0.12) keeps two
/// unread frames and then only the newest.
class VideoSource {
public:
    virtual ~VideoSource() = default;

    /// Waits for the next whole frame, at most `timeout_ns` (0: does not wait), and writes it into `frame`
    /// (frame_bytes of the format). False: timeout, or `status` has an error.
    [[nodiscard]] virtual bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) = 0;
    /// An error when no frame can arrive: the stream has another format than requested, or is not video.
    [[nodiscard]] const Status& status() const noexcept { return status_; }
    [[nodiscard]] const VideoSourceCounters& counters() const noexcept { return counters_; }
    [[nodiscard]] virtual std::string description() const = 0;

protected:
    Status status_{Ok{}};
    VideoSourceCounters counters_{};
};

/// SOURCE: a text of one of the kinds in open_video.cpp. Does not wait for a writer: errors that only its stream
/// shows are in `status` later.
Result<std::unique_ptr<VideoSource>> open_video_source(std::string_view spec, const VideoFormat& format);
/// All kinds, for --help.
[[nodiscard]] std::string video_source_help();

}  // namespace narpa
