// Datagrams as pulses: what triggers is that one comes.
#include <array>

#include "drivers/datagram.h"
#include "drivers/pulse/backends.h"
#include "drivers/udp_listener.h"

namespace narpa {
namespace {

class UdpPulses final : public PulseSource {
public:
    explicit UdpPulses(UdpListener listener) : listener_(std::move(listener)) {}

    [[nodiscard]] std::optional<std::int64_t> receive() noexcept override {
        std::array<std::uint8_t, 1> ignored{};
        const Datagram d = receive_datagram(listener_.fd.get(), ignored);
        if (d.bytes < 0) return std::nullopt;
        ++counters_.received;
        counters_.lost += loss_.increase_to(d.lost);
        return d.t_received_ns;
    }
    [[nodiscard]] std::string description() const override {
        return "datagrams at " + listener_.host + ", port " + listener_.port;
    }

private:
    UdpListener listener_;
    LossCount loss_;
};

}  // namespace

Result<std::unique_ptr<PulseSource>> open_udp_pulses(const std::string& text) {
    auto listener = listen_udp(text, "udp:" + text);
    if (!listener) return listener.error();
    return std::unique_ptr<PulseSource>(std::make_unique<UdpPulses>(*std::move(listener)));
}

}  // namespace narpa
