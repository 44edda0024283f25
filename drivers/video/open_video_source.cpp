#include <sys/stat.h>

#include <exception>

#include "drivers/video/backends.h"

namespace narpa {
namespace {

Error no_such_path(const std::string& spec) {
    Error error{"video source \"" + spec + "\": no such file or device", {}, 0, 0, ErrorKind::missing};
    if (!spec.starts_with("/dev/"))
        error.remedy = "mkfifo " + spec + "   (then narpa run --video CAMERA=" + spec + ")";
    return error;
}

Result<std::unique_ptr<VideoSource>> open_by_kind(const std::string& spec, const VideoFormat& format) {
    struct stat info {};
    const bool exists = ::stat(spec.c_str(), &info) == 0;
    if (spec.starts_with("/dev/video") || (exists && S_ISCHR(info.st_mode))) return open_v4l2_source(spec, format);
    if (exists && (S_ISFIFO(info.st_mode) || spec.ends_with(".y4m"))) return open_y4m_source(spec, format);
    if (!exists && !spec.empty()) return no_such_path(spec);
    return Error{"video source \"" + spec + "\": expected /dev/videoN, FILE.y4m, or an existing FIFO"};
}

}  // namespace

Result<std::unique_ptr<VideoSource>> open_video_source(std::string_view spec, const VideoFormat& format) {
    if (format.width <= 0 || format.height <= 0) return Error{"video: width and height must be positive"};
    try {
        return open_by_kind(std::string(spec), format);
    } catch (const std::exception& e) {  // no memory
        return Error{"video source \"" + std::string(spec) + "\": " + e.what(), {}, 0, 0, ErrorKind::missing};
    }
}

}  // namespace narpa
