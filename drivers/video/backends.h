/// drivers/video/backends.h - the video sinks and sources behind open_video_sink and open_video_source.
#pragma once

#include <memory>
#include <string>

#include "drivers/video/video_sink.h"
#include "drivers/video/video_source.h"

namespace narpa {

/// Frames that the ring of a sink holds: 0.8 s at 10 Hz, so a disk may pause.
inline constexpr std::size_t kVideoSlots = 8;

/// Checks the device, its format and starts it; a device that vanishes later is looked for once a second.
Result<std::unique_ptr<VideoSink>> open_v4l2_sink(const std::string& path, const VideoFormat& format,
                                                  WhenFull full);
/// `fifo`: the path is a FIFO; else a file, made or emptied.
Result<std::unique_ptr<VideoSink>> open_y4m_sink(const std::string& path, bool fifo, const VideoFormat& format,
                                                 WhenFull full);
Result<std::unique_ptr<VideoSink>> open_null_sink(const VideoFormat& format);

/// A device that is no camera yet (v4l2loopback before its writer's first frame) is looked at again.
Result<std::unique_ptr<VideoSource>> open_v4l2_source(const std::string& path, const VideoFormat& format);
Result<std::unique_ptr<VideoSource>> open_y4m_source(const std::string& path, const VideoFormat& format);

}  // namespace narpa
