#include "drivers/video/gige_camera.h"

#ifdef NARPA_WITH_ARAVIS
#include <arpa/inet.h>
#include <arv.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "drivers/descriptor.h"
#include "protocols/video/gige_description.h"
#endif

namespace narpa {

#ifdef NARPA_WITH_ARAVIS

namespace {

/// How often Aravis polls for a frame. It busy-waits for the last millisecond of each period: at 1000 Hz that cost
/// 60 % of a processor, at this rate 12 to 17 %, for an added latency of at most 5 ms.
constexpr double kPolls_hz = 200;
constexpr std::chrono::milliseconds kGiveUpPeriod{20};
/// GigE Vision's block numbers: 16 bits, 0 is none.
constexpr std::uint32_t kBlocks = 65535;
/// Where GigE Vision has the names, and their bytes with the final 0.
constexpr std::uint32_t kMakerAt = 0x48, kModelAt = 0x68, kNameBytes = 32;
constexpr const char* kGigeSerial = "0001";
constexpr std::uint16_t kGigePort = 3956;

/// Aravis shares the port with another camera, of which clients then see one or the other.
Status check_gige_port(const std::string& address) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(kGigePort);
    if (::inet_pton(AF_INET, address.c_str(), &at.sin_addr) != 1)
        return Error{"expected gige:ADDRESS with an IPv4 address of this machine, as in gige:192.168.1.5"};
    const Descriptor fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (fd && ::bind(fd.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0) return Ok{};
    if (errno == EADDRINUSE)
        return Error{.what = "port 3956 is taken: a machine has one GigE Vision camera at an address",
                     .kind = ErrorKind::missing,
                     .remedy = "ss -lunp 'sport = :3956'   (who has it)"};
    return Error{.what = std::strerror(errno),
                 .kind = ErrorKind::missing,
                 .remedy = "ip -br -4 address   (the addresses of this machine)"};
}

/// A file that is there while Aravis reads it.
class DescriptionFile {
public:
    explicit DescriptionFile(const std::string& text) {
        const int fd = ::mkstemp(name_.data());
        if (fd < 0) return;
        good_ = ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
        ::close(fd);
    }
    ~DescriptionFile() { ::unlink(name_.data()); }
    DescriptionFile(const DescriptionFile&) = delete;
    DescriptionFile& operator=(const DescriptionFile&) = delete;
    [[nodiscard]] bool good() const noexcept { return good_; }
    [[nodiscard]] const char* name() const noexcept { return name_.data(); }

private:
    std::string name_ = (std::filesystem::temp_directory_path() / "narpa-gige-XXXXXX").string();
    bool good_ = false;
};

class AravisCamera final : public GigeCamera {
public:
    AravisCamera(const std::string& address, const VideoFormat& format, const GigePixelFormat& pixels,
                 const DescriptionFile& description)
        : format_(format),
          code_(pixels.code),
          gv_(arv_gv_fake_camera_new_full(address.c_str(), kGigeSerial, description.name())) {
        if (!is_running()) return;
        camera_ = arv_gv_fake_camera_get_fake_camera(gv_);
        write_name(kMakerAt, "narpa");
        write_name(kModelAt, "camera");
        const auto width = static_cast<std::uint32_t>(format.width),
                   height = static_cast<std::uint32_t>(format.height);
        write(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, width);
        write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, height);
        write(ARV_FAKE_CAMERA_REGISTER_WIDTH, width);
        write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, height);
        write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, code_);
        // By software trigger, which is given here: so Aravis sends each frame once, when it is there.
        write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE, 1);
        write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE, 1);
        arv_fake_camera_set_trigger_frequency(camera_, kPolls_hz);
        arv_fake_camera_set_fill_pattern(camera_, fill, this);
    }
    ~AravisCamera() override {
        g_clear_object(&gv_);  // joins its thread
    }
    [[nodiscard]] bool is_running() const noexcept { return gv_ != nullptr && arv_gv_fake_camera_is_running(gv_); }

    [[nodiscard]] Shown show(std::span<const std::uint8_t> frame, std::int64_t t_ns, std::uint32_t number,
                             const std::function<bool()>& give_up) noexcept override {
        if (!has_client()) return Shown::no_client;
        std::unique_lock lock(mutex_);
        frame_ = frame, t_ns_ = t_ns, number_ = number;
        write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
        Shown shown = Shown::whole;
        while (!frame_.empty()) {
            copied_.wait_for(lock, kGiveUpPeriod);
            if (frame_.empty()) break;
            shown = !has_client() ? Shown::no_client : give_up() ? Shown::timed_out : Shown::whole;
            if (shown == Shown::whole) continue;
            write(ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 0);
            frame_ = {};
        }
        return shown;
    }

private:
    void write(std::uint32_t address, std::uint32_t value) noexcept {
        arv_fake_camera_write_register(camera_, address, value);
    }
    void write_name(std::uint32_t address, std::string_view name) {
        std::array<char, kNameBytes> text{};
        std::ranges::copy(name, text.begin());
        arv_fake_camera_write_memory(camera_, address, text.size(), text.data());
    }
    [[nodiscard]] bool has_client() const noexcept {
        return arv_fake_camera_get_control_channel_privilege(camera_) != 0 &&
               arv_fake_camera_get_acquisition_status(camera_) != 0;
    }

    /// On Aravis's thread.
    static void fill(ArvBuffer* buffer, void* self, guint32, guint32, ArvPixelFormat) {
        static_cast<AravisCamera*>(self)->fill(buffer);
    }
    void fill(ArvBuffer* buffer) {
        const std::lock_guard lock(mutex_);
        // The size of the buffer is that of the registers, which the description does not let clients change.
        const bool fits = arv_buffer_get_image_width(buffer) == format_.width &&
                          arv_buffer_get_image_height(buffer) == format_.height &&
                          arv_buffer_get_image_pixel_format(buffer) == code_;
        if (frame_.empty() || !fits) return;
        // Aravis has its patterns written through this pointer, too.
        auto* data = const_cast<void*>(arv_buffer_get_data(buffer, nullptr));
        std::memcpy(data, frame_.data(), frame_.size());
        arv_buffer_set_timestamp(buffer, static_cast<guint64>(t_ns_));
        arv_buffer_set_frame_id(buffer, number_ % kBlocks + 1);
        frame_ = {};
        copied_.notify_one();
    }

    VideoFormat format_;
    ArvPixelFormat code_;
    ArvGvFakeCamera* gv_;
    ArvFakeCamera* camera_ = nullptr;
    std::mutex mutex_;
    std::condition_variable copied_;
    std::span<const std::uint8_t> frame_;  ///< to be copied; empty: none
    std::int64_t t_ns_ = 0;
    std::uint32_t number_ = 0;
};

}  // namespace

Result<std::unique_ptr<GigeCamera>> GigeCamera::open(const std::string& address, const VideoFormat& format) {
    const auto pixels = gige_pixel_format(format);
    if (!pixels) return pixels.error();
    if (auto free = check_gige_port(address); !free) return free.error();
    const DescriptionFile description(gige_description(format, *pixels,
                                                       {.width = ARV_FAKE_CAMERA_REGISTER_WIDTH,
                                                        .height = ARV_FAKE_CAMERA_REGISTER_HEIGHT,
                                                        .pixel_format = ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT,
                                                        .sensor_width = ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH,
                                                        .sensor_height = ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT,
                                                        .acquisition = ARV_FAKE_CAMERA_REGISTER_ACQUISITION}));
    if (!description.good())
        return Error{std::string("cannot write ") + description.name() + ": " + std::strerror(errno),
                     {},
                     0,
                     0,
                     ErrorKind::missing};
    auto camera = std::make_unique<AravisCamera>(address, format, *pixels, description);
    if (camera->is_running()) return std::unique_ptr<GigeCamera>(std::move(camera));
    return Error{.what = "Aravis cannot use this address: it must be that of an interface which is up",
                 .kind = ErrorKind::missing,
                 .remedy = "ip -br -4 address   (the addresses of this machine)"};
}

#else

Result<std::unique_ptr<GigeCamera>> GigeCamera::open(const std::string&, const VideoFormat&) {
    return Error{.what = "narpa was built without Aravis, which speaks GigE Vision",
                 .kind = ErrorKind::missing,
                 .remedy = "apt install libaravis-dev, cmake -DNARPA_WITH_ARAVIS=ON ..., and build again"};
}

#endif

}  // namespace narpa
