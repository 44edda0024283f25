#include "drivers/can/can_bus.h"

#include <net/if.h>

#include <algorithm>
#include <array>

#include "drivers/can/buses.h"
#include "drivers/can/redundant_bus.h"

namespace narpa {
namespace {

struct CanBusKind : DeviceKind {
    CanBusResult (*open)(const std::string& rest, CanRole role);
};

bool is_interface_name(const std::string& text);
bool is_interface(const std::string& text) {
    return text.starts_with("can") || text.starts_with("vcan") || ::if_nametoindex(text.c_str()) != 0;
}

bool is_pair(const std::string& text) {
    return !redundant_parts(text).empty();
}

constexpr std::array kBuses{
    CanBusKind{{"", "BUS+BUS", "BUS+BUS (two redundant buses, as --can given twice)", is_pair}, open_redundant},
    CanBusKind{{"", "an interface (can0, vcan0)", "vcan0, can0 (SocketCAN)", is_interface_name, is_interface},
               open_socketcan},
    CanBusKind{{"slcan:", "slcan:PORT", "slcan:[ADDRESS:]PORT (slcan clients over TCP or a pty)"}, open_slcan},
    CanBusKind{{"udp:", "udp:GROUP", "udp:239.74.163.2 (multicast on this machine)"}, open_udp_multicast},
    CanBusKind{{"usb:", "usb:[ADAPTER]", "usb:[ADAPTER][/CHANNEL][@BIT_RATE[,DATA_BIT_RATE]] (a gs_usb adapter)"},
               open_gs_usb},
    CanBusKind{{"memory:", "memory:NAME", "memory:NAME (within one process: the Python package)"}, open_memory_bus},
    CanBusKind{{"log:", "log:FILE", "log:FILE[:INTERFACE] (a candump log)"}, open_candump},
};
constexpr std::span<const CanBusKind> kBusTable{kBuses};

/// A prefix without its colon is a mistake.
bool is_interface_name(const std::string& text) {
    return !text.empty() && text.size() < IFNAMSIZ && text.find_first_of(":/+ \t") == text.npos &&
           std::ranges::none_of(kBusTable, [&](const CanBusKind& k) { return k.prefix == text + ":"; });
}

}  // namespace

const DeviceKind* can_bus_kind(const std::string& spec) {
    return find_kind(kBusTable, spec);
}
std::string can_bus_help() {
    return help_of(kBusTable);
}

CanBusResult open_can_bus(std::string_view spec, CanRole role) {
    const std::string text(spec);
    if (const CanBusKind* kind = find_kind(kBusTable, text)) return kind->open(kind->rest_of(text), role);
    return Error{"unknown CAN bus \"" + text + "\": expected " + forms_of(kBusTable)};
}

}  // namespace narpa
