/// drivers/usb/usb_device.h - a USB device in software: what UsbIpServer serves to a host. A new kind of device
/// implements this interface; the server stays as it is.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocols/usb/descriptors.h"

namespace narpa {

struct UsbDescriptors {
    UsbSpeed speed = UsbSpeed::full;
    UsbDeviceDescriptor device{};
    std::vector<std::uint8_t> configuration{};  ///< whole, with its interfaces
    std::vector<std::string> strings{};         ///< string 1 is the first
};

/// Results of a transfer other than a number of bytes: negative Linux error numbers.
struct UsbAnswer {
    static constexpr int kStall = -32;     ///< EPIPE
    static constexpr int kBabble = -75;    ///< EOVERFLOW: more than the host asked for
    static constexpr int kPending = -115;  ///< EINPROGRESS: not yet; asked again after UsbIpServer::wake
};

/// All functions are called on the server's thread, one after the other.
class UsbDevice {
public:
    virtual ~UsbDevice() = default;

    [[nodiscard]] virtual const UsbDescriptors& descriptors() const noexcept = 0;
    /// A host has taken the device (the cable is in) or let it go. Before the first call it is out.
    virtual void plugged(bool in) noexcept = 0;
    /// Handles requests of a class or vendor, and the standard requests SET_INTERFACE and CLEAR_FEATURE of an
    /// endpoint. `data`: the received bytes, or towards the host the room for as many bytes as it asked for.
    /// Returns the number of bytes, or UsbAnswer::kStall.
    [[nodiscard]] virtual int control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept = 0;
    /// A transfer from the host. `endpoint`: its number. Returns the number of bytes taken, or a UsbAnswer.
    [[nodiscard]] virtual int take(int endpoint, std::span<const std::uint8_t> data) noexcept = 0;
    /// A transfer towards the host: fills `room` from its start. Returns the number of bytes, or a UsbAnswer.
    [[nodiscard]] virtual int give(int endpoint, std::span<std::uint8_t> room) noexcept = 0;
};

}  // namespace narpa
