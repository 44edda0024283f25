// A sink that is a USB camera for whichever machine attaches it over USB/IP.
#include "drivers/usb/usbip_server.h"
#include "drivers/usb/uvc_device.h"
#include "drivers/video/backends.h"

namespace narpa {
namespace {

class UvcWriter final : public VideoWriter {
public:
    UvcWriter(const VideoFormat& format, const std::optional<VideoControls>& controls)
        : device_(format, controls, "NARPA-CAMERA") {}
    Status start(const ListenAddress& at) {
        auto server = UsbIpServer::start(at.host, at.port, device_);
        if (!server) return server.error();
        server_ = *std::move(server);
        return Ok{};
    }
    [[nodiscard]] std::uint16_t port() const noexcept { return server_->port(); }

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp&,
                     const WriteQueue& queue) noexcept override {
        reconnects = device_.streams();
        const auto shown = device_.show(
            frame, monotonic_ns(), [this] { server_->wake(); }, [&] { return queue.time_left_ms() == 0; });
        reconnects = device_.streams();
        switch (shown) {
            case UvcDevice::Shown::whole: ++written; break;
            case UvcDevice::Shown::no_stream: ++no_reader; break;
            case UvcDevice::Shown::broken: ++failed; break;
        }
    }
    bool next_request(VideoRequest& request) noexcept override { return device_.next_request(request); }

private:
    UvcDevice device_;
    std::unique_ptr<UsbIpServer> server_;
};

}  // namespace

VideoSinkResult open_uvc_sink(const std::string& address, const VideoSinkOptions& o) {
    const VideoFormat& format = o.format;
    auto at = parse_listen_address(address);
    if (!at) return Error{"uvc:" + address + ": expected uvc:[ADDRESS:]PORT, such as uvc:3240"};
    if (!uvc_carries(format.pixel) || !format.link.is_samples())
        return Error{"uvc:" + address + ": a USB camera here carries GREY, Y16 and YUYV, not " +
                     link_text(format.pixel, format.link) + "; expected another format of the camera in the scene"};
    constexpr int kMax = 65535;  // of a frame descriptor
    if (format.width > kMax || format.height > kMax)
        return Error{"uvc:" + address + ": expected at most 65535 pixels each way"};
    auto writer = std::make_unique<UvcWriter>(format, o.controls);
    if (auto started = writer->start(*at); !started) return started.error();
    const std::string port = std::to_string(writer->port());
    std::string text = "USB camera at " + at->host + ":" + port + "; on the host, as root: usbip --tcp-port " +
                       port + " attach -r HOST -b " + std::string(UsbIpServer::kBusId);
    return queued_sink(std::move(writer), format, o.full, std::move(text));
}

}  // namespace narpa
