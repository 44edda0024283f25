/// drivers/usb/usb_control.h - the control requests that every USB device answers alike (USB 2.0, chapter 9).
#pragma once

#include <cstdint>
#include <span>

#include "drivers/usb/usb_device.h"

namespace narpa {

/// Answers these requests from the device's descriptors and passes the others to UsbDevice::control. Returns what
/// UsbDevice::control returns.
[[nodiscard]] int usb_control(UsbDevice& device, const UsbSetup& setup, std::span<std::uint8_t> data) noexcept;

}  // namespace narpa
