/// drivers/can/usb_spec.h - which USB-CAN adapter a BUS text names, and how its channel is to run.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

struct UsbCanSpec {
    std::string adapter{};  ///< serial number, or the port path as in Linux (1-4.2); empty: the only one
    std::uint8_t channel = 0;
    std::uint32_t bit_rate = 1'000'000;
    std::uint32_t data_bit_rate = 4'000'000;  ///< of CAN FD's data phase
    friend bool operator==(const UsbCanSpec&, const UsbCanSpec&) = default;
};

/// Parses the text after `usb:`, [ADAPTER][/CHANNEL][@BIT_RATE[,DATA_BIT_RATE]].
Result<UsbCanSpec> parse_usb_can(std::string_view text);

}  // namespace narpa
