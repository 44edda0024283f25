/// protocols/usb/descriptors.h - control requests and descriptors of USB <-> plain structs (USB 2.0 specification,
/// chapter 9). No devices, no libusb.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace narpa {

// --- Control requests ------------------------------------------------

/// The eight bytes that begin a control transfer.
struct UsbSetup {
    std::uint8_t type = 0;  ///< bmRequestType: direction, kind, recipient
    std::uint8_t request = 0;
    std::uint16_t value = 0, index = 0;
    std::uint16_t length = 0;  ///< of the data stage, bytes

    [[nodiscard]] bool to_host() const noexcept { return (type & 0x80) != 0; }
    /// 0 standard, 1 class, 2 vendor.
    [[nodiscard]] int kind() const noexcept { return type >> 5 & 3; }
    /// 0 device, 1 interface, 2 endpoint.
    [[nodiscard]] int recipient() const noexcept { return type & 0x1f; }
    friend bool operator==(const UsbSetup&, const UsbSetup&) = default;
};
inline constexpr std::size_t kUsbSetupBytes = 8;
[[nodiscard]] UsbSetup decode_usb_setup(std::span<const std::uint8_t, kUsbSetupBytes> bytes) noexcept;
void encode_usb_setup(const UsbSetup& setup, std::span<std::uint8_t, kUsbSetupBytes> out) noexcept;

/// Requests that every device knows.
struct UsbRequest {
    static constexpr std::uint8_t kGetStatus = 0, kClearFeature = 1, kSetFeature = 3, kGetDescriptor = 6,
                                  kGetConfiguration = 8, kSetConfiguration = 9, kGetInterface = 10,
                                  kSetInterface = 11;
};

// --- Descriptors -----------------------------------------------------

struct UsbDescriptorType {
    static constexpr std::uint8_t kDevice = 1, kConfiguration = 2, kString = 3, kInterface = 4, kEndpoint = 5,
                                  kQualifier = 6, kAssociation = 11, kClassInterface = 0x24;
};

/// Numbered as USB/IP numbers them.
enum class UsbSpeed : std::uint8_t { low = 1, full = 2, high = 3, super = 5 };

struct UsbDeviceDescriptor {
    std::uint16_t usb = 0x0200;  ///< BCD, as `release`
    std::uint8_t device_class = 0, subclass = 0, protocol = 0;
    std::uint8_t max_packet = 64;  ///< of endpoint 0
    std::uint16_t vendor = 0, product = 0, release = 0x0100;
    std::uint8_t maker_string = 0, product_string = 0, serial_string = 0;  ///< 0: none
    std::uint8_t configurations = 1;
    friend bool operator==(const UsbDeviceDescriptor&, const UsbDeviceDescriptor&) = default;
};
inline constexpr std::size_t kUsbDeviceDescriptorBytes = 18;
[[nodiscard]] std::array<std::uint8_t, kUsbDeviceDescriptorBytes> encode_usb_device(
    const UsbDeviceDescriptor& device) noexcept;
[[nodiscard]] std::optional<UsbDeviceDescriptor> decode_usb_device(std::span<const std::uint8_t> bytes) noexcept;
/// Device qualifier: the properties of a high-speed device at full speed, here the same.
[[nodiscard]] std::array<std::uint8_t, 10> encode_usb_qualifier(const UsbDeviceDescriptor& device) noexcept;

struct UsbEndpoint {
    std::uint8_t address = 0;     ///< number, | 0x80 towards the host
    std::uint8_t attributes = 0;  ///< lowest two bits: 0 control, 1 isochronous, 2 bulk, 3 interrupt
    std::uint16_t max_packet = 0;
    [[nodiscard]] bool to_host() const noexcept { return (address & 0x80) != 0; }
    [[nodiscard]] bool is_bulk() const noexcept { return (attributes & 3) == 2; }
    friend bool operator==(const UsbEndpoint&, const UsbEndpoint&) = default;
};
struct UsbInterface {
    std::uint8_t number = 0, alternate = 0;
    std::uint8_t interface_class = 0, subclass = 0, protocol = 0;
    std::vector<UsbEndpoint> endpoints{};
    friend bool operator==(const UsbInterface&, const UsbInterface&) = default;
};
struct UsbConfiguration {
    std::uint8_t value = 1;
    std::vector<UsbInterface> interfaces{};
    friend bool operator==(const UsbConfiguration&, const UsbConfiguration&) = default;
};
/// Nothing: lengths that do not fit, endpoints missing or before the first interface, fewer interfaces than
/// promised. Descriptors of other types are skipped.
[[nodiscard]] std::optional<UsbConfiguration> decode_usb_configuration(std::span<const std::uint8_t> bytes);

/// Puts a configuration together, descriptor after descriptor.
class UsbConfigurationWriter {
public:
    /// `power_ma`: at most 500.
    UsbConfigurationWriter(std::uint8_t interfaces, int power_ma);
    /// Any descriptor, with its length first.
    UsbConfigurationWriter& add(std::span<const std::uint8_t> descriptor);
    UsbConfigurationWriter& interface(const UsbInterface& interface, std::uint8_t endpoints);
    UsbConfigurationWriter& endpoint(const UsbEndpoint& endpoint);
    /// All of it, with its whole length filled in.
    [[nodiscard]] std::vector<std::uint8_t> bytes() const;

private:
    std::vector<std::uint8_t> bytes_;
};

/// ASCII text as UTF-16; longer than 126 characters is cut.
[[nodiscard]] std::vector<std::uint8_t> encode_usb_string(std::string_view text);
/// The languages that strings come in: US English alone.
[[nodiscard]] std::vector<std::uint8_t> usb_languages();

}  // namespace narpa
