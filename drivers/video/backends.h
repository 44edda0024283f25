/// drivers/video/backends.h - the video sinks behind open_video_sink.
#pragma once

#include <memory>
#include <string>

#include "drivers/video/video_sink.h"

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

}  // namespace narpa
