/// protocols/usb/usbip.h - USB over TCP as Linux speaks it (drivers/usb/usbip, version 1.1.1): messages <-> plain
/// structs. No sockets. All integers are big-endian. Source: Documentation/usb/usbip_protocol.rst of the kernel.
///
/// A host first asks for the list of devices, or imports one; after an import the connection carries transfers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "protocols/usb/descriptors.h"

namespace narpa {

inline constexpr std::uint16_t kUsbIpVersion = 0x0111;

// --- Before an import ------------------------------------------------

enum class UsbIpOp : std::uint16_t {
    import_request = 0x8003,
    import_reply = 0x0003,
    list_request = 0x8005,
    list_reply = 0x0005,
};
struct UsbIpOpHeader {
    UsbIpOp op{};
    std::uint32_t status = 0;  ///< 0: good
    friend bool operator==(const UsbIpOpHeader&, const UsbIpOpHeader&) = default;
};
inline constexpr std::size_t kUsbIpOpBytes = 8, kUsbIpBusIdBytes = 32, kUsbIpDeviceBytes = 312;
/// Status of a refused import (tools/usb/usbip/libsrc/usbip_common.h).
inline constexpr std::uint32_t kUsbIpBusy = 2, kUsbIpNoDevice = 4;

/// Nothing: another version, or an operation that is none of these.
[[nodiscard]] std::optional<UsbIpOpHeader> decode_usbip_op(
    std::span<const std::uint8_t, kUsbIpOpBytes> bytes) noexcept;
[[nodiscard]] std::array<std::uint8_t, kUsbIpOpBytes> encode_usbip_op(const UsbIpOpHeader& header) noexcept;
/// The bus id of an import request. Nothing: not terminated within its 32 bytes, or empty.
[[nodiscard]] std::optional<std::string> decode_usbip_bus_id(std::span<const std::uint8_t, kUsbIpBusIdBytes> bytes);

struct UsbIpDevice {
    std::string path, bus_id;  ///< at most 255 and 31 characters
    std::uint32_t bus = 1, number = 2;
    UsbSpeed speed = UsbSpeed::full;
    UsbDeviceDescriptor device{};
    UsbConfiguration configuration{};
};
/// The answer to a list: header, count, and each device with its interfaces.
[[nodiscard]] std::vector<std::uint8_t> encode_usbip_list(std::span<const UsbIpDevice> devices);
/// The answer to an import that succeeds: header and device.
[[nodiscard]] std::vector<std::uint8_t> encode_usbip_import(const UsbIpDevice& device);

// --- After it --------------------------------------------------------

inline constexpr std::size_t kUsbIpHeaderBytes = 48;
/// Longer transfers than this are refused; Linux asks for at most 16 KiB of a camera and 1 KiB of an adapter.
inline constexpr std::uint32_t kUsbIpLongestTransfer = 1 << 20;

/// One transfer. Those out of the host are followed by `length` bytes.
struct UsbIpSubmit {
    std::uint32_t sequence = 0;
    std::uint8_t endpoint = 0;
    bool to_host = false;
    std::uint32_t length = 0;
    UsbSetup setup{};  ///< where endpoint is 0
    friend bool operator==(const UsbIpSubmit&, const UsbIpSubmit&) = default;
};
/// Cancels a transfer.
struct UsbIpUnlink {
    std::uint32_t sequence = 0;
    std::uint32_t victim = 0;  ///< sequence of the transfer
    friend bool operator==(const UsbIpUnlink&, const UsbIpUnlink&) = default;
};
using UsbIpRequest = std::variant<UsbIpSubmit, UsbIpUnlink>;

/// Nothing: no such command; an endpoint above 15; longer than kUsbIpLongestTransfer; isochronous. The start of the
/// next message is unknown then, so the connection ends.
[[nodiscard]] std::optional<UsbIpRequest> decode_usbip_request(
    std::span<const std::uint8_t, kUsbIpHeaderBytes> bytes) noexcept;
void encode_usbip_request(const UsbIpRequest& request, std::span<std::uint8_t, kUsbIpHeaderBytes> out) noexcept;

/// The answer to a transfer or to its cancellation.
struct UsbIpReply {
    bool to_unlink = false;
    std::uint32_t sequence = 0;
    std::int32_t status = 0;   ///< 0, or -errno as Linux numbers them: -32 stall, -104 cancelled
    std::uint32_t length = 0;  ///< bytes transferred; towards the host, they follow
    friend bool operator==(const UsbIpReply&, const UsbIpReply&) = default;
};
void encode_usbip_reply(const UsbIpReply& reply, std::span<std::uint8_t, kUsbIpHeaderBytes> out) noexcept;
[[nodiscard]] std::optional<UsbIpReply> decode_usbip_reply(
    std::span<const std::uint8_t, kUsbIpHeaderBytes> bytes) noexcept;

}  // namespace narpa
