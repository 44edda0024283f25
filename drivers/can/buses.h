/// drivers/can/buses.h - one opener for each row of the table in can_bus.cpp. They get the text after the
/// prefix.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/can/can_bus.h"
#include "drivers/tcp_listener.h"

namespace narpa {

using CanBusResult = Result<std::unique_ptr<CanBus>>;

CanBusResult open_socketcan(const std::string& interface, CanRole role);
/// `text`: `[ADDRESS:]PORT` of the hub, on loopback without an address. A hub takes a free port for 0, which
/// description() names. A client returns once the hub has opened the channel: no frame of the bus is missed after
/// that.
CanBusResult open_slcan(const std::string& text, CanRole role);
CanBusResult open_slcan_hub(const ListenAddress& at);
CanBusResult open_slcan_client(const ListenAddress& at);
/// `group`: an IPv4 multicast address.
CanBusResult open_udp_multicast(const std::string& group, CanRole role);
/// A USB-CAN adapter through libusb. `text`: drivers/can/usb_spec.h. A missing one is an error; one that is pulled
/// out later is looked for once a second.
CanBusResult open_gs_usb(const std::string& text, CanRole role);
/// Two buses, whose texts are joined by a plus sign: redundant_bus.h.
CanBusResult open_redundant(const std::string& text, CanRole role);
/// Within one process. The client opens it first, then the hub: a hub without a client is an error.
CanBusResult open_memory_bus(const std::string& name, CanRole role);
/// A hub reads the log, a client writes it.
CanBusResult open_candump(const std::string& path, CanRole role);

/// The smallest length of a CAN FD frame that holds `size` bytes (ISO 11898-1: 0..8, 12, 16, 20, 24, 32, 48, 64).
[[nodiscard]] constexpr std::uint8_t fd_length(std::uint8_t size) noexcept {
    if (size <= 8) return size;
    for (const int length : {12, 16, 20, 24, 32, 48})
        if (size <= length) return static_cast<std::uint8_t>(length);
    return 64;
}

/// The frame at that length; what is added is zero.
[[nodiscard]] inline CanFrame padded(CanFrame frame) noexcept {
    if (frame.fd) frame.size = fd_length(frame.size);
    return frame;
}

/// True for frames that every bus can carry: lengths and identifiers in range, no error reports, no remote FD
/// frames.
[[nodiscard]] constexpr bool sendable(const CanFrame& f) noexcept {
    if (f.error || (f.fd && f.remote) || f.size > (f.fd ? 64 : 8)) return false;
    return f.id <= (f.extended ? 0x1FFFFFFFu : 0x7FFu);
}

}  // namespace narpa
