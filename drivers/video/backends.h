/// drivers/video/backends.h - the video sinks and sources behind the rows of the tables in open_video.cpp.
/// They get the text after the prefix.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/video/video_sink.h"
#include "drivers/video/video_source.h"
#include "drivers/write_queue.h"

namespace narpa {

/// Writes the frames of a queue and counts them.
class VideoWriter : public QueueWriter {
public:
    /// Writes a frame, or counts why not; may block as QueueWriter::write may.
    /// `frame`: as its link carries it, link_bytes.
    virtual void write_frame(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                             const WriteQueue& queue) noexcept = 0;
    /// An item: the stamp, then the frame.
    void write(std::span<const std::uint8_t> item, const WriteQueue& queue) noexcept final;
    void abandon(std::span<const std::uint8_t>) noexcept override { ++failed; }
    /// See VideoSink::next_request.
    virtual bool next_request(VideoRequest& /*request*/) noexcept { return false; }

    std::atomic<std::uint64_t> written{0}, no_reader{0}, failed{0}, reconnects{0};
    std::atomic<int> file_error{0};  ///< errno of a file that did not take a frame

private:
    friend std::unique_ptr<VideoSink> queued_sink(std::unique_ptr<VideoWriter>, const VideoFormat&, WhenFull,
                                                  std::string);
    VideoFormat format_{};
    std::vector<std::uint8_t> laid_out_{};  ///< empty where the link has the samples
};
/// A sink that queues frames for the writer. It counts frames of another size as failed.
std::unique_ptr<VideoSink> queued_sink(std::unique_ptr<VideoWriter> writer, const VideoFormat& format,
                                       WhenFull full, std::string description);

using VideoSinkResult = Result<std::unique_ptr<VideoSink>>;
using VideoSourceResult = Result<std::unique_ptr<VideoSource>>;

struct VideoSinkOptions {
    VideoFormat format;
    WhenFull full;
    std::optional<VideoControls> controls;
};

/// Opens the device, checks its format and starts it; a device that vanishes later is looked for once a second.
VideoSinkResult open_v4l2_sink(const std::string& path, const VideoSinkOptions& o);
/// `address`: [HOST:]PORT to listen at for hosts that attach the camera.
VideoSinkResult open_uvc_sink(const std::string& address, const VideoSinkOptions& o);
/// `text`: [VENDOR:PRODUCT/][SERIAL|BUS-PORT]; a bridge that vanishes later is looked for once a second.
VideoSinkResult open_bulk_sink(const std::string& text, const VideoSinkOptions& o);
/// `address`: [HOST:]PORT to listen at for clients that read Y4M.
VideoSinkResult open_tcp_sink(const std::string& address, const VideoSinkOptions& o);
/// `text`: HOST[%INTERFACE]:PORT[,mtu=N][,mbit_s=N][,ttl=N].
VideoSinkResult open_udp_video_sink(const std::string& text, const VideoSinkOptions& o);
/// `text`: the same, and [,sdp=FILE], which is written.
VideoSinkResult open_rtp_sink(const std::string& text, const VideoSinkOptions& o);
/// `address`: of an interface of this machine, IPv4; empty: the loopback.
VideoSinkResult open_gige_sink(const std::string& address, const VideoSinkOptions& o);
/// The file is made or emptied.
VideoSinkResult open_y4m_file(const std::string& path, const VideoSinkOptions& o);
VideoSinkResult open_y4m_fifo(const std::string& path, const VideoSinkOptions& o);

/// A device that is no camera yet (v4l2loopback before its writer's first frame) is tried again.
VideoSourceResult open_v4l2_source(const std::string& path, const VideoFormat& format);
/// `address`: [HOST:]PORT to listen at for the host that attaches the bridge.
VideoSourceResult open_bridge_source(const std::string& address, const VideoFormat& format);
/// `text`: udp_listener.h; the options of a sink have no effect.
VideoSourceResult open_udp_video_source(const std::string& text, const VideoFormat& format);
/// The same. It has the samples, whatever the link of the format.
VideoSourceResult open_rtp_source(const std::string& text, const VideoFormat& format);
VideoSourceResult open_y4m_source(const std::string& path, const VideoFormat& format);

}  // namespace narpa
