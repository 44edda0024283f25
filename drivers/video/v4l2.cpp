#include <fcntl.h>

#include <cerrno>
#include <cstring>
#include <numeric>

#include "drivers/descriptor.h"
#include "drivers/video/backends.h"
#include "drivers/video/v4l2_device.h"

// The method follows v4l2loopback 0.12.7 (Debian 12): memory-mapped output always returns the same buffer, so
// frames go by write(); an unknown format is "accepted" as another, so the result is compared; without STREAMON
// before the first write the device is unusable once the writer has closed it, and newer versions (0.13) refuse
// that same STREAMON with EINVAL, harmlessly. See v4l2loopback issues 191, 442 and 607.

namespace narpa {
namespace {

enum class Step : std::uint8_t { open, query, output, format_call, format_kept, stream, started };

// The step that the start of a device reached. Only error messages turn it into text.
struct Start {
    Step step = Step::open;
    int error = 0;
    v4l2_pix_format got{};
    Descriptor fd{};
};

void set_frame_rate(int fd, std::int64_t period_ns) noexcept {
    const std::int64_t common = std::gcd(period_ns, kSecond_ns);
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    parameters.parm.output.timeperframe = {static_cast<std::uint32_t>(period_ns / common),
                                           static_cast<std::uint32_t>(kSecond_ns / common)};
    xioctl(fd, VIDIOC_S_PARM, &parameters);  // readers only show it, so a refusal costs nothing
}

Start start_steps(int fd, const VideoFormat& format) noexcept {
    const std::uint32_t capabilities = v4l2_capabilities(fd);
    if (capabilities == 0) return {Step::query, errno};
    if (!(capabilities & V4L2_CAP_VIDEO_OUTPUT)) return {Step::output, 0};

    Start start{Step::format_kept};
    for (const v4l2_pix_format& pix : {v4l2_wanted_format(format), v4l2_carrier_format(format)}) {
        v4l2_format f{};
        f.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
        f.fmt.pix = pix;
        start = {xioctl(fd, VIDIOC_S_FMT, &f) < 0 ? Step::format_call : Step::format_kept, errno, f.fmt.pix};
        if (start.step == Step::format_kept && is_same_format(f.fmt.pix, pix)) start.step = Step::started;
        if (start.step == Step::started) break;
    }
    if (start.step != Step::started) return start;
    set_frame_rate(fd, format.period_ns);
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    if (xioctl(fd, VIDIOC_STREAMON, &type) < 0 && errno != EINVAL) return {Step::stream, errno};
    return start;
}

Start start_device(const char* path, const VideoFormat& format) noexcept {
    Descriptor fd(::open(path, O_RDWR | O_CLOEXEC));
    if (!fd) return {Step::open, errno};
    Start start = start_steps(fd.get(), format);
    if (start.step == Step::started) start.fd = std::move(fd);
    return start;
}

Error describe(const std::string& path, const VideoFormat& format, const Start& start) {
    const std::string load = v4l2loopback_remedy(path);
    const std::string reload = "sudo modprobe -r v4l2loopback && " + load;
    Error error{{}, path, 0, 0, ErrorKind::missing, load};
    const std::string why = std::strerror(start.error);
    switch (start.step) {
        case Step::open:
            error.what = "cannot open the video device: " + why;
            if (start.error == EACCES) error.remedy = "sudo usermod -aG video $USER   (then log in again)";
            if (start.error == EBUSY) error.remedy = "close the other program that writes to it";
            break;
        case Step::query:
            error.what = "not a V4L2 device (" + why + "); expected a video output such as v4l2loopback's";
            break;
        case Step::output:
            error.what =
                "this V4L2 device takes no frames (a camera, or a v4l2loopback that another program writes to "
                "or left unusable)";
            error.remedy = reload;
            break;
        case Step::format_call:
            error.what = "the device refuses " + format_text(v4l2_wanted_format(format)) + ": " + why;
            error.remedy = reload;
            break;
        case Step::format_kept:
            error.what = "asked for " + format_text(v4l2_wanted_format(format)) + ", the device stays at " +
                         format_text(start.got) + "; a reader may hold it open, or it cannot do this format";
            error.remedy = "close its readers, or " + reload;
            break;
        case Step::stream: error.what = "cannot start output: " + why; break;
        case Step::started: break;
    }
    return error;
}

class V4l2Writer final : public VideoWriter {
public:
    V4l2Writer(std::string path, const VideoFormat& format, Descriptor fd)
        : path_(std::move(path)), format_(format), fd_(std::move(fd)) {}

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp&, const WriteQueue&) noexcept override {
        if (!fd_ && !reopen()) return abandon(frame);
        ssize_t n = 0;
        do n = ::write(fd_.get(), frame.data(), frame.size());
        while (n < 0 && errno == EINTR);
        if (n == static_cast<ssize_t>(frame.size())) {
            ++written;
            return;
        }
        if (n < 0 && errno != EAGAIN) {
            fd_.reset();
            (void)retry_.due();  // not before a second has passed
        }
        abandon(frame);
    }

private:
    bool reopen() noexcept {
        if (!retry_.due()) return false;
        fd_ = start_device(path_.c_str(), format_).fd;
        if (fd_) ++reconnects;
        return static_cast<bool>(fd_);
    }

    std::string path_;
    VideoFormat format_;
    Descriptor fd_;
    RetryTimer retry_{};
};

}  // namespace

VideoSinkResult open_v4l2_sink(const std::string& path, const VideoSinkOptions& o) {
    Start start = start_device(path.c_str(), o.format);
    if (start.step != Step::started) return describe(path, o.format, start);
    return queued_sink(std::make_unique<V4l2Writer>(path, o.format, std::move(start.fd)), o.format, o.full,
                       "V4L2 output " + path + ", " + format_text(start.got));
}

}  // namespace narpa
