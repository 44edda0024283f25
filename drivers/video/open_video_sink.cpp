#include <sys/stat.h>

#include <exception>

#include "drivers/video/backends.h"

namespace narpa {
namespace {

Result<std::unique_ptr<VideoSink>> open_by_kind(const std::string& spec, const VideoFormat& format, WhenFull full) {
    if (spec == "none") return open_null_sink(format);
    struct stat info {};
    const bool exists = ::stat(spec.c_str(), &info) == 0;
    if (exists && S_ISFIFO(info.st_mode)) return open_y4m_sink(spec, true, format, full);
    if (spec.ends_with(".y4m")) return open_y4m_sink(spec, false, format, full);
    if (spec.starts_with("/dev/video") || (exists && S_ISCHR(info.st_mode)))
        return open_v4l2_sink(spec, format, full);
    return Error{"video sink \"" + spec + "\": expected /dev/videoN, FILE.y4m, an existing FIFO, or none"};
}

}  // namespace

Result<std::unique_ptr<VideoSink>> open_video_sink(std::string_view spec, const VideoFormat& format,
                                                   WhenFull full) {
    if (format.width <= 0 || format.height <= 0 || format.period_ns <= 0)
        return Error{"video: width, height and frame period must be positive"};
    if (format.pixel == PixelFormat::yuyv && format.width % 2 != 0)
        return Error{"video: YUYV needs an even width, not " + std::to_string(format.width)};
    try {
        return open_by_kind(std::string(spec), format, full);
    } catch (const std::exception& e) {  // no memory, no thread, no descriptor left
        return Error{"video sink \"" + std::string(spec) + "\": " + e.what(), {}, 0, 0, ErrorKind::missing};
    }
}

}  // namespace narpa
