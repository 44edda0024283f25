/// drivers/usb/usb_devices.h - the USB devices that are plugged in, found and opened through libusb.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

struct libusb_config_descriptor;
struct libusb_context;
struct libusb_device_handle;
struct libusb_transfer;

namespace narpa {

struct UsbId {
    std::uint16_t vendor = 0, product = 0;
};

/// The devices that a driver here serves.
struct UsbKind {
    std::string_view name;    ///< in messages: "USB-CAN adapter"
    std::string_view prefix;  ///< of command lines: "usb:"
    std::span<const UsbId> ids;
    std::string_view remedy;  ///< what to try where none is plugged in
};

struct PluggedUsbDevice {
    std::string place;      ///< port path, as in Linux: 1-4.2
    std::string serial{};   ///< empty: none, or it cannot be read without a permission
    std::string trouble{};  ///< why it cannot be opened; empty: it can
    [[nodiscard]] const std::string& name() const noexcept { return serial.empty() ? place : serial; }
};

/// Text: how to permit users to open the devices.
[[nodiscard]] std::string usb_permission_remedy();
/// True for texts that can be a serial number or a port path (printable ASCII), and for an empty one.
[[nodiscard]] bool is_usb_name(std::string_view text) noexcept;
/// The Error of a program that was built without libusb.
[[nodiscard]] Error built_without_usb();

struct LibusbRelease {
    void operator()(libusb_context* c) const noexcept;
    void operator()(libusb_device_handle* h) const noexcept;
    void operator()(libusb_transfer* t) const noexcept;
    void operator()(libusb_config_descriptor* c) const noexcept;
};
template <class T>
using LibusbOwned = std::unique_ptr<T, LibusbRelease>;

struct OpenUsbDevice {
    LibusbOwned<libusb_context> context;
    LibusbOwned<libusb_device_handle> handle;
    PluggedUsbDevice what;
};

/// Error: a machine without USB.
Result<std::vector<PluggedUsbDevice>> list_usb_devices(std::span<const UsbId> ids);
/// `wanted`: a serial number or a port path; empty: the only one. Errors name those that are plugged in.
Result<OpenUsbDevice> open_usb_device(const UsbKind& kind, std::string_view wanted);
/// `code`: error code of libusb.
[[nodiscard]] Error usb_error(const std::string& what, int code);

}  // namespace narpa
