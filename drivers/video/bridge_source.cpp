// Frames that come to a frame bridge in software: the other end of a bulk sink, on whichever machine attaches it.
#include "drivers/usb/bridge_device.h"
#include "drivers/usb/usbip_server.h"
#include "drivers/video/backends.h"

namespace narpa {
namespace {

class BridgeSource final : public VideoSource {
public:
    explicit BridgeSource(const VideoFormat& format) : device_(format, "NARPA-BRIDGE") {}
    Status start(const ListenAddress& at) {
        auto server = UsbIpServer::start(at.host, at.port, device_);
        if (!server) return server.error();
        server_ = *std::move(server);
        host_ = at.host;
        return Ok{};
    }

    [[nodiscard]] bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) override {
        BulkFrameHeader header;
        const bool any = device_.receive(frame, header, timeout_ns, [this] { server_->wake(); });
        counters_ = device_.counters();
        return any;
    }
    [[nodiscard]] std::string description() const override {
        const std::string port = std::to_string(server_->port());
        return "USB frame bridge at " + host_ + ":" + port + "; on the host, as root: usbip --tcp-port " + port +
               " attach -r HOST -b " + std::string(UsbIpServer::kBusId);
    }

private:
    BridgeDevice device_;
    std::string host_;
    std::unique_ptr<UsbIpServer> server_;  // ends before the device
};

}  // namespace

VideoSourceResult open_bridge_source(const std::string& address, const VideoFormat& format) {
    auto at = parse_listen_address(address);
    if (!at) return Error{"bridge:" + address + ": expected bridge:[ADDRESS:]PORT, such as bridge:3242"};
    auto source = std::make_unique<BridgeSource>(format);
    if (auto started = source->start(*at); !started) return started.error();
    return std::unique_ptr<VideoSource>(std::move(source));
}

}  // namespace narpa
