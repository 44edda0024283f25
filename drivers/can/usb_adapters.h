/// drivers/can/usb_adapters.h - the USB-CAN adapters (gs_usb) that are plugged in.
#pragma once

#include <vector>

#include "base/result.h"
#include "drivers/usb/usb_devices.h"

namespace narpa {

/// Error: built without libusb, or a machine without USB.
Result<std::vector<PluggedUsbDevice>> find_usb_adapters();

}  // namespace narpa
