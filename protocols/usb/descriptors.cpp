#include "protocols/usb/descriptors.h"

#include <algorithm>

#include "protocols/little_endian.h"

namespace narpa {

UsbSetup decode_usb_setup(std::span<const std::uint8_t, kUsbSetupBytes> b) noexcept {
    return {b[0], b[1], get_le<std::uint16_t>(&b[2]), get_le<std::uint16_t>(&b[4]), get_le<std::uint16_t>(&b[6])};
}

void encode_usb_setup(const UsbSetup& s, std::span<std::uint8_t, kUsbSetupBytes> out) noexcept {
    out[0] = s.type, out[1] = s.request;
    put_le(&out[2], s.value), put_le(&out[4], s.index), put_le(&out[6], s.length);
}

std::array<std::uint8_t, kUsbDeviceDescriptorBytes> encode_usb_device(const UsbDeviceDescriptor& d) noexcept {
    std::array<std::uint8_t, kUsbDeviceDescriptorBytes> b{kUsbDeviceDescriptorBytes, UsbDescriptorType::kDevice};
    put_le(&b[2], d.usb);
    b[4] = d.device_class, b[5] = d.subclass, b[6] = d.protocol, b[7] = d.max_packet;
    put_le(&b[8], d.vendor), put_le(&b[10], d.product), put_le(&b[12], d.release);
    b[14] = d.maker_string, b[15] = d.product_string, b[16] = d.serial_string, b[17] = d.configurations;
    return b;
}

std::optional<UsbDeviceDescriptor> decode_usb_device(std::span<const std::uint8_t> b) noexcept {
    if (b.size() != kUsbDeviceDescriptorBytes || b[0] != b.size() || b[1] != UsbDescriptorType::kDevice)
        return std::nullopt;
    UsbDeviceDescriptor d;
    d.usb = get_le<std::uint16_t>(&b[2]);
    d.device_class = b[4], d.subclass = b[5], d.protocol = b[6], d.max_packet = b[7];
    d.vendor = get_le<std::uint16_t>(&b[8]), d.product = get_le<std::uint16_t>(&b[10]);
    d.release = get_le<std::uint16_t>(&b[12]);
    d.maker_string = b[14], d.product_string = b[15], d.serial_string = b[16], d.configurations = b[17];
    if (d.configurations == 0) return std::nullopt;
    return d;
}

std::array<std::uint8_t, 10> encode_usb_qualifier(const UsbDeviceDescriptor& d) noexcept {
    std::array<std::uint8_t, 10> b{10, UsbDescriptorType::kQualifier};
    put_le(&b[2], d.usb);
    b[4] = d.device_class, b[5] = d.subclass, b[6] = d.protocol, b[7] = d.max_packet, b[8] = d.configurations;
    return b;
}

std::optional<UsbConfiguration> decode_usb_configuration(std::span<const std::uint8_t> bytes) {
    if (bytes.size() < 9 || bytes[0] != 9 || bytes[1] != UsbDescriptorType::kConfiguration ||
        get_le<std::uint16_t>(&bytes[2]) != bytes.size())
        return std::nullopt;
    UsbConfiguration c{bytes[5]};
    const int promised = bytes[4];
    std::size_t endpoints_missing = 0;
    std::array<bool, 256> seen{};
    for (auto rest = bytes.subspan(9); !rest.empty(); rest = rest.subspan(rest[0])) {
        const std::size_t length = rest[0];
        if (length < 2 || length > rest.size()) return std::nullopt;
        if (rest[1] == UsbDescriptorType::kInterface) {
            if (length != 9 || endpoints_missing != 0) return std::nullopt;
            c.interfaces.push_back({rest[2], rest[3], rest[5], rest[6], rest[7]});
            endpoints_missing = rest[4];
            seen[rest[2]] = true;
        } else if (rest[1] == UsbDescriptorType::kEndpoint) {
            if (length < 7 || endpoints_missing == 0) return std::nullopt;
            c.interfaces.back().endpoints.push_back({rest[2], rest[3], get_le<std::uint16_t>(&rest[4])});
            --endpoints_missing;
        }
    }
    if (endpoints_missing != 0 || std::count(seen.begin(), seen.end(), true) != promised) return std::nullopt;
    return c;
}

UsbConfigurationWriter::UsbConfigurationWriter(std::uint8_t interfaces, int power_ma)
    : bytes_{9,
             UsbDescriptorType::kConfiguration,
             0,
             0,
             interfaces,
             1,
             0,
             0x80,
             static_cast<std::uint8_t>(std::min(power_ma, 500) / 2)} {}

UsbConfigurationWriter& UsbConfigurationWriter::add(std::span<const std::uint8_t> descriptor) {
    bytes_.insert(bytes_.end(), descriptor.begin(), descriptor.end());
    return *this;
}

UsbConfigurationWriter& UsbConfigurationWriter::interface(const UsbInterface& i, std::uint8_t endpoints) {
    const std::array<std::uint8_t, 9> b{9,          UsbDescriptorType::kInterface,
                                        i.number,   i.alternate,
                                        endpoints,  i.interface_class,
                                        i.subclass, i.protocol,
                                        0};
    return add(b);
}

UsbConfigurationWriter& UsbConfigurationWriter::endpoint(const UsbEndpoint& e) {
    std::array<std::uint8_t, 7> b{7, UsbDescriptorType::kEndpoint, e.address, e.attributes};
    put_le(&b[4], e.max_packet);
    return add(b);
}

std::vector<std::uint8_t> UsbConfigurationWriter::bytes() const {
    std::vector<std::uint8_t> whole = bytes_;
    put_le(&whole[2], static_cast<std::uint16_t>(whole.size()));
    return whole;
}

std::vector<std::uint8_t> encode_usb_string(std::string_view text) {
    text = text.substr(0, 126);
    std::vector<std::uint8_t> b{static_cast<std::uint8_t>(2 + 2 * text.size()), UsbDescriptorType::kString};
    for (const char c : text) b.push_back(static_cast<std::uint8_t>(c)), b.push_back(0);
    return b;
}

std::vector<std::uint8_t> usb_languages() {
    return {4, UsbDescriptorType::kString, 0x09, 0x04};
}

}  // namespace narpa
