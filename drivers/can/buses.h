/// drivers/can/buses.h - one opener for each kind of bus; `open_can_bus` chooses among them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/can/can_bus.h"

namespace narpa {

using CanBusResult = Result<std::unique_ptr<CanBus>>;

CanBusResult open_socketcan(const std::string& interface);
/// Port 0 takes a free port; description() names it.
CanBusResult open_slcan_hub(std::uint16_t port);
/// Returns once the hub has opened the channel: no frame of the bus is missed after that.
CanBusResult open_slcan_client(std::uint16_t port);
/// `group`: an IPv4 multicast address.
CanBusResult open_udp_multicast(const std::string& group);
/// A USB-CAN adapter through libusb. `text`: drivers/can/usb_spec.h. A missing one is an error; one that is pulled
/// out later is looked for once a second.
CanBusResult open_gs_usb(std::string_view text);
CanBusResult open_candump_reader(const std::string& path);
CanBusResult open_candump_writer(const std::string& path);

/// The smallest length of a CAN FD frame that holds `size` bytes (ISO 11898-1: 0..8, 12, 16, 20, 24, 32, 48, 64).
[[nodiscard]] constexpr std::uint8_t fd_length(std::uint8_t size) noexcept {
    if (size <= 8) return size;
    for (const int length : {12, 16, 20, 24, 32, 48})
        if (size <= length) return static_cast<std::uint8_t>(length);
    return 64;
}

/// True for frames that every bus can carry: lengths and identifiers in range, no error reports, no remote FD
/// frames.
[[nodiscard]] constexpr bool sendable(const CanFrame& f) noexcept {
    if (f.error || (f.fd && f.remote) || f.size > (f.fd ? 64 : 8)) return false;
    return f.id <= (f.extended ? 0x1FFFFFFFu : 0x7FFu);
}

}  // namespace narpa
