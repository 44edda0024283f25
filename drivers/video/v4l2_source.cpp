// Frames from a V4L2 capture device, by memory-mapped streaming. v4l2loopback with exclusive_caps=1 is a capture
// device only once its writer streams, and has the writer's format.
#include <fcntl.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "drivers/descriptor.h"
#include "drivers/video/backends.h"
#include "drivers/video/v4l2_device.h"

namespace narpa {
namespace {

constexpr std::uint32_t kBuffers = 4;
constexpr std::int64_t kPollPeriod_ns = 20'000'000;  // between two checks whether the device can capture yet

/// A buffer of the driver, mapped as long as this lives.
class MappedBuffer {
public:
    MappedBuffer() = default;
    MappedBuffer(int fd, std::uint32_t bytes, std::uint32_t offset) noexcept
        : data_(::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, static_cast<off_t>(offset))),
          bytes_(bytes) {}
    MappedBuffer(MappedBuffer&& other) noexcept
        : data_(std::exchange(other.data_, MAP_FAILED)), bytes_(other.bytes_) {}
    MappedBuffer& operator=(MappedBuffer&& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(bytes_, other.bytes_);
        return *this;
    }
    ~MappedBuffer() {
        if (*this) ::munmap(data_, bytes_);
    }
    explicit operator bool() const noexcept { return data_ != MAP_FAILED; }
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept {
        return {static_cast<const std::uint8_t*>(data_), bytes_};
    }

private:
    void* data_ = MAP_FAILED;
    std::size_t bytes_ = 0;
};

v4l2_buffer capture_buffer(std::uint32_t index = 0) noexcept {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
}

/// A device that streams into mapped buffers.
struct Camera {
    Descriptor fd{};
    std::array<MappedBuffer, kBuffers> buffers{};
};

enum class Stage : std::uint8_t { no_camera_yet, streaming };

Error cannot(const std::string& what) {
    return {.what = what + ": " + std::strerror(errno), .kind = ErrorKind::missing};
}

/// Negotiates the format. Before its writer has set one, v4l2loopback reports zeros or fails.
Result<Stage> agree_on_format(int fd, const VideoFormat& format) {
    const v4l2_pix_format wanted = v4l2_wanted_format(format);
    v4l2_format f{};
    f.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (xioctl(fd, VIDIOC_G_FMT, &f) < 0 || f.fmt.pix.width == 0) return Stage::no_camera_yet;
    if (is_same_format(f.fmt.pix, wanted)) return Stage::streaming;
    const v4l2_pix_format before = f.fmt.pix;
    f.fmt.pix = wanted;
    if (xioctl(fd, VIDIOC_S_FMT, &f) < 0) f.fmt.pix = before;
    if (is_same_format(f.fmt.pix, wanted) || is_same_format(f.fmt.pix, v4l2_carrier_format(format)))
        return Stage::streaming;
    return Error{.what =
                     "expected frames of " + format_text(wanted) + ", the device has " + format_text(f.fmt.pix)};
}

Result<Stage> start_streaming(Camera& camera) {
    const int fd = camera.fd.get();
    v4l2_requestbuffers request{};
    request.count = kBuffers;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    if (xioctl(fd, VIDIOC_REQBUFS, &request) < 0) return cannot("the device gives no buffers");
    for (std::uint32_t i = 0; i < std::min(request.count, kBuffers); ++i) {
        v4l2_buffer buffer = capture_buffer(i);
        if (xioctl(fd, VIDIOC_QUERYBUF, &buffer) < 0) return cannot("the device does not describe its buffers");
        camera.buffers[i] = MappedBuffer(fd, buffer.length, buffer.m.offset);
        if (!camera.buffers[i]) return cannot("the device's buffers cannot be mapped");
        if (xioctl(fd, VIDIOC_QBUF, &buffer) < 0) return cannot("the device takes no buffer");
    }
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (xioctl(fd, VIDIOC_STREAMON, &type) < 0) return Stage::no_camera_yet;
    return Stage::streaming;
}

Result<Stage> start(const std::string& path, const VideoFormat& format, Camera& camera) {
    camera.fd = Descriptor(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
    if (!camera.fd) {
        Error error = cannot("cannot open the video device");
        error.remedy =
            errno == EACCES ? "sudo usermod -aG video $USER   (then log in again)" : v4l2loopback_remedy(path);
        return error;
    }
    const std::uint32_t capabilities = v4l2_capabilities(camera.fd.get());
    if (capabilities == 0) return cannot("not a V4L2 device; expected a camera or a v4l2loopback");
    if (!(capabilities & V4L2_CAP_VIDEO_CAPTURE) && !(capabilities & V4L2_CAP_VIDEO_OUTPUT))
        return Error{.what = "this V4L2 device gives no frames", .kind = ErrorKind::missing};
    if (!(capabilities & V4L2_CAP_VIDEO_CAPTURE)) return Stage::no_camera_yet;
    const Result<Stage> format_stage = agree_on_format(camera.fd.get(), format);
    return format_stage && *format_stage == Stage::streaming ? start_streaming(camera) : format_stage;
}

class V4l2Source final : public VideoSource {
public:
    V4l2Source(const std::string& path, const VideoFormat& format, Camera camera, Stage stage)
        : path_(path), format_(format), camera_(std::move(camera)), stage_(stage) {}

    [[nodiscard]] bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) override {
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        while (status_) {
            if (stage_ == Stage::no_camera_yet) look_again();
            if (stage_ == Stage::streaming && take(frame)) return true;
            const std::int64_t left_ns = until_ns - monotonic_ns();
            if (left_ns <= 0) return false;
            std::array<pollfd, 1> fds{{{camera_.fd.get(), POLLIN, 0}}};
            if (stage_ == Stage::streaming)
                wait_ready(fds, left_ns);
            else
                wait_ready({}, std::min(left_ns, kPollPeriod_ns));
            if ((fds[0].revents & POLLERR) != 0) stop();  // it streams no more
        }
        return false;
    }

    [[nodiscard]] std::string description() const override {
        return "V4L2 capture " + path_ + ", " + format_text(v4l2_wanted_format(format_));
    }

private:
    bool take(std::span<std::uint8_t> frame) {
        for (;;) {
            v4l2_buffer buffer = capture_buffer();
            if (xioctl(camera_.fd.get(), VIDIOC_DQBUF, &buffer) < 0) {
                if (errno != EAGAIN) stop();
                return false;
            }
            note_sequence(buffer.sequence);
            const std::span<const std::uint8_t> bytes = camera_.buffers[buffer.index % kBuffers].bytes();
            const bool whole = buffer.bytesused == frame.size() && frame.size() <= bytes.size();
            if (whole) std::copy_n(bytes.begin(), frame.size(), frame.begin());
            if (xioctl(camera_.fd.get(), VIDIOC_QBUF, &buffer) < 0) stop();
            ++(whole ? counters_.received : counters_.truncated);
            if (whole) return true;
            if (stage_ != Stage::streaming) return false;
        }
    }

    void note_sequence(std::uint32_t sequence) noexcept {
        if (has_sequence_ && sequence > sequence_) counters_.lost += sequence - sequence_ - 1;
        sequence_ = sequence;
        has_sequence_ = true;
    }

    void look_again() {
        Camera fresh;
        const Result<Stage> stage = start(path_, format_, fresh);
        if (stage && *stage == Stage::streaming) {
            camera_ = std::move(fresh);
            stage_ = *stage;
        } else if (!stage && stage.error().kind == ErrorKind::bad_input) {  // it is there, with another format
            status_ = stage.error();
            status_.error().file = path_;
        }
    }

    void stop() noexcept {
        camera_ = {};
        has_sequence_ = false;
        stage_ = Stage::no_camera_yet;
    }

    std::string path_;
    VideoFormat format_;
    Camera camera_;
    Stage stage_;
    std::uint32_t sequence_ = 0;  ///< of the frame before
    bool has_sequence_ = false;
};

}  // namespace

VideoSourceResult open_v4l2_source(const std::string& path, const VideoFormat& format) {
    Camera camera;
    const Result<Stage> stage = start(path, format, camera);
    if (!stage) {
        Error error = stage.error();
        error.file = path;
        return error;
    }
    return std::unique_ptr<VideoSource>(std::make_unique<V4l2Source>(path, format, std::move(camera), *stage));
}

}  // namespace narpa
