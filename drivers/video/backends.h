/// drivers/video/backends.h - the video sinks and sources behind open_video_sink and open_video_source.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "drivers/video/video_sink.h"
#include "drivers/video/video_source.h"
#include "drivers/write_queue.h"

namespace narpa {

/// Writes the frames of a queue and counts them.
class VideoWriter : public QueueWriter {
public:
    /// Writes a frame, or counts why not; may block as QueueWriter::write may.
    virtual void write_frame(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                             const WriteQueue& queue) noexcept = 0;
    /// An item: the stamp, then the frame.
    void write(std::span<const std::uint8_t> item, const WriteQueue& queue) noexcept final;
    void abandon(std::span<const std::uint8_t>) noexcept override { ++failed; }
    /// See VideoSink::next_request.
    virtual bool next_request(VideoRequest& /*request*/) noexcept { return false; }

    std::atomic<std::uint64_t> written{0}, no_reader{0}, failed{0}, reconnects{0};
    std::atomic<int> file_error{0};  ///< errno of a file that did not take a frame
};
/// A sink that queues frames for the writer. It counts frames of another size as failed.
std::unique_ptr<VideoSink> queued_sink(std::unique_ptr<VideoWriter> writer, const VideoFormat& format,
                                       WhenFull full, std::string description);

/// Opens the device, checks its format and starts it; a device that vanishes later is looked for once a second.
Result<std::unique_ptr<VideoSink>> open_v4l2_sink(const std::string& path, const VideoFormat& format,
                                                  WhenFull full);
/// `address`: [HOST:]PORT to listen at for hosts that attach the camera.
Result<std::unique_ptr<VideoSink>> open_uvc_sink(std::string_view address, const VideoFormat& format, WhenFull full,
                                                 const std::optional<VideoControls>& controls);
/// `text`: [VENDOR:PRODUCT/][SERIAL|BUS-PORT]; a bridge that vanishes later is looked for once a second.
Result<std::unique_ptr<VideoSink>> open_bulk_sink(std::string_view text, const VideoFormat& format, WhenFull full);
/// `fifo`: the path is a FIFO; else a file, made or emptied.
Result<std::unique_ptr<VideoSink>> open_y4m_sink(const std::string& path, bool fifo, const VideoFormat& format,
                                                 WhenFull full);

/// A device that is no camera yet (v4l2loopback before its writer's first frame) is tried again.
Result<std::unique_ptr<VideoSource>> open_v4l2_source(const std::string& path, const VideoFormat& format);
/// `address`: [HOST:]PORT to listen at for the host that attaches the bridge.
Result<std::unique_ptr<VideoSource>> open_bridge_source(std::string_view address, const VideoFormat& format);
Result<std::unique_ptr<VideoSource>> open_y4m_source(const std::string& path, const VideoFormat& format);

}  // namespace narpa
