/// drivers/can/usb_adapters.h - the USB-CAN adapters (gs_usb) that are plugged in.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"

namespace narpa {

struct UsbAdapter {
    std::string place;      ///< of the plug, as Linux writes it: 1-4.2
    std::string serial{};   ///< empty: none, or it cannot be read without a permission
    std::string trouble{};  ///< why it cannot be opened; empty: it can
};

/// Error: built without libusb, or a machine without USB.
Result<std::vector<UsbAdapter>> find_usb_adapters();
/// What permits users to open them.
[[nodiscard]] std::string usb_permission_remedy();

}  // namespace narpa
