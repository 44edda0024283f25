#include "protocols/usb/usbip.h"

#include <algorithm>

#include "protocols/big_endian.h"

namespace narpa {
namespace {

constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitted = 3, kUnlinked = 4;
constexpr std::uint32_t kNoPackets = 0xffff'ffff;  // packet count of non-isochronous transfers (new kernels)

void put_usbip_text(std::uint8_t* at, std::size_t room, const std::string& text) noexcept {
    std::copy_n(text.begin(), std::min(text.size(), room - 1), at);
}

std::array<std::uint8_t, kUsbIpDeviceBytes> encode_usbip_device(const UsbIpDevice& d) noexcept {
    std::array<std::uint8_t, kUsbIpDeviceBytes> b{};
    put_usbip_text(&b[0], 256, d.path);
    put_usbip_text(&b[256], kUsbIpBusIdBytes, d.bus_id);
    put_be(&b[288], d.bus), put_be(&b[292], d.number), put_be(&b[296], static_cast<std::uint32_t>(d.speed));
    put_be(&b[300], d.device.vendor), put_be(&b[302], d.device.product), put_be(&b[304], d.device.release);
    b[306] = d.device.device_class, b[307] = d.device.subclass, b[308] = d.device.protocol;
    b[309] = d.configuration.value, b[310] = d.device.configurations;
    b[311] = static_cast<std::uint8_t>(d.configuration.interfaces.size());
    return b;
}

}  // namespace

std::optional<UsbIpOpHeader> decode_usbip_op(std::span<const std::uint8_t, kUsbIpOpBytes> b) noexcept {
    const auto op = static_cast<UsbIpOp>(get_be<std::uint16_t>(&b[2]));
    if (get_be<std::uint16_t>(&b[0]) != kUsbIpVersion) return std::nullopt;
    for (const UsbIpOp known :
         {UsbIpOp::import_request, UsbIpOp::import_reply, UsbIpOp::list_request, UsbIpOp::list_reply})
        if (op == known) return UsbIpOpHeader{op, get_be<std::uint32_t>(&b[4])};
    return std::nullopt;
}

std::array<std::uint8_t, kUsbIpOpBytes> encode_usbip_op(const UsbIpOpHeader& h) noexcept {
    std::array<std::uint8_t, kUsbIpOpBytes> b{};
    put_be(&b[0], kUsbIpVersion), put_be(&b[2], static_cast<std::uint16_t>(h.op)), put_be(&b[4], h.status);
    return b;
}

std::optional<std::string> decode_usbip_bus_id(std::span<const std::uint8_t, kUsbIpBusIdBytes> b) {
    const auto end = std::find(b.begin(), b.end(), std::uint8_t{0});
    if (end == b.end() || end == b.begin()) return std::nullopt;
    return std::string(b.begin(), end);
}

std::vector<std::uint8_t> encode_usbip_list(std::span<const UsbIpDevice> devices) {
    const auto header = encode_usbip_op({UsbIpOp::list_reply, 0});
    std::vector<std::uint8_t> b(header.begin(), header.end());
    b.resize(b.size() + 4);
    put_be(&b[kUsbIpOpBytes], static_cast<std::uint32_t>(devices.size()));
    for (const UsbIpDevice& d : devices) {
        const auto bytes = encode_usbip_device(d);
        b.insert(b.end(), bytes.begin(), bytes.end());
        for (const UsbInterface& i : d.configuration.interfaces)
            b.insert(b.end(), {i.interface_class, i.subclass, i.protocol, 0});
    }
    return b;
}

std::vector<std::uint8_t> encode_usbip_import(const UsbIpDevice& device) {
    const auto header = encode_usbip_op({UsbIpOp::import_reply, 0});
    const auto bytes = encode_usbip_device(device);
    std::vector<std::uint8_t> b(header.begin(), header.end());
    b.insert(b.end(), bytes.begin(), bytes.end());
    return b;
}

std::optional<UsbIpRequest> decode_usbip_request(std::span<const std::uint8_t, kUsbIpHeaderBytes> b) noexcept {
    const auto word = [&](std::size_t at) { return get_be<std::uint32_t>(&b[at]); };
    if (word(0) == kUnlink) return UsbIpUnlink{word(4), word(20)};
    if (word(0) != kSubmit) return std::nullopt;
    const std::uint32_t direction = word(12), endpoint = word(16), packets = word(32);
    if (direction > 1 || endpoint > 15 || word(24) > kUsbIpLongestTransfer) return std::nullopt;
    if (packets != 0 && packets != kNoPackets) return std::nullopt;
    return UsbIpSubmit{word(4), static_cast<std::uint8_t>(endpoint), direction == 1, word(24),
                       decode_usb_setup(b.subspan<40, kUsbSetupBytes>())};
}

void encode_usbip_request(const UsbIpRequest& request, std::span<std::uint8_t, kUsbIpHeaderBytes> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint8_t{0});
    constexpr std::uint32_t kDevice = 1 << 16 | 2;
    put_be(&out[8], kDevice);
    if (const auto* unlink = std::get_if<UsbIpUnlink>(&request)) {
        put_be(&out[0], kUnlink), put_be(&out[4], unlink->sequence), put_be(&out[20], unlink->victim);
        return;
    }
    const auto& submit = std::get<UsbIpSubmit>(request);
    put_be(&out[0], kSubmit), put_be(&out[4], submit.sequence);
    put_be(&out[12], std::uint32_t{submit.to_host}), put_be(&out[16], std::uint32_t{submit.endpoint});
    put_be(&out[24], submit.length);
    encode_usb_setup(submit.setup, out.subspan<40, kUsbSetupBytes>());
}

void encode_usbip_reply(const UsbIpReply& r, std::span<std::uint8_t, kUsbIpHeaderBytes> out) noexcept {
    std::fill(out.begin(), out.end(), std::uint8_t{0});
    put_be(&out[0], r.to_unlink ? kUnlinked : kSubmitted);
    put_be(&out[4], r.sequence), put_be(&out[20], static_cast<std::uint32_t>(r.status));
    if (!r.to_unlink) put_be(&out[24], r.length);
}

std::optional<UsbIpReply> decode_usbip_reply(std::span<const std::uint8_t, kUsbIpHeaderBytes> b) noexcept {
    const auto word = [&](std::size_t at) { return get_be<std::uint32_t>(&b[at]); };
    if (word(0) != kSubmitted && word(0) != kUnlinked) return std::nullopt;
    const bool to_unlink = word(0) == kUnlinked;
    return UsbIpReply{to_unlink, word(4), static_cast<std::int32_t>(word(20)), to_unlink ? 0 : word(24)};
}

}  // namespace narpa
