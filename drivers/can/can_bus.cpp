#include "drivers/can/can_bus.h"

#include <net/if.h>

#include "base/read_number.h"
#include "drivers/can/buses.h"

namespace narpa {
namespace {

CanBusResult open_slcan(std::string_view text, CanRole role) {
    std::uint16_t port = 0;
    // Port 0 lets the kernel choose; only a listening socket can do that.
    if (!read_number(text, port) || (port == 0 && role == CanRole::client))
        return Error{"slcan:" + std::string(text) + ": expected a TCP port from 1 to 65535, such as slcan:29537"};
    return role == CanRole::hub ? open_slcan_hub(port) : open_slcan_client(port);
}

}  // namespace

CanBusResult open_can_bus(std::string_view spec, CanRole role) {
    const std::size_t colon = spec.find(':');
    const std::string_view scheme = spec.substr(0, colon);
    if (colon != std::string_view::npos) {
        const std::string_view rest = spec.substr(colon + 1);
        if (scheme == "slcan") return open_slcan(rest, role);
        if (scheme == "udp") return open_udp_multicast(std::string(rest));
        if (scheme == "usb") return open_gs_usb(rest);
        if (scheme == "log") {
            if (rest.empty()) return Error{"log: expected the name of a candump log, such as log:run.log"};
            return role == CanRole::hub ? open_candump_reader(std::string(rest))
                                        : open_candump_writer(std::string(rest));
        }
    } else if (scheme != "slcan" && scheme != "udp" && scheme != "usb" && scheme != "log" && !spec.empty() &&
               spec.size() < IFNAMSIZ && spec.find_first_of("/ \t") == std::string_view::npos) {
        return open_socketcan(std::string(spec));
    }
    return Error{"unknown CAN bus \"" + std::string(spec) +
                 "\": expected an interface (can0, vcan0), slcan:PORT, udp:GROUP, usb:[ADAPTER] or log:FILE"};
}

}  // namespace narpa
