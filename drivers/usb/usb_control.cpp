#include "drivers/usb/usb_control.h"

#include <algorithm>
#include <array>

namespace narpa {

int usb_control(UsbDevice& device, const UsbSetup& setup, std::span<std::uint8_t> data) noexcept {
    const UsbDescriptors& d = device.descriptors();
    const auto answer = [&](std::span<const std::uint8_t> bytes) {
        const std::size_t n = std::min(bytes.size(), data.size());
        std::copy_n(bytes.begin(), n, data.begin());
        return static_cast<int>(n);
    };
    if (setup.kind() != 0) return device.control(setup, data);
    switch (setup.request) {
        case UsbRequest::kGetDescriptor:
            switch (const std::size_t number = setup.value & 0xff; setup.value >> 8) {
                case UsbDescriptorType::kDevice: return answer(encode_usb_device(d.device));
                case UsbDescriptorType::kConfiguration:
                    return number == 0 ? answer(d.configuration) : UsbAnswer::kStall;
                case UsbDescriptorType::kQualifier:
                    return d.speed == UsbSpeed::high ? answer(encode_usb_qualifier(d.device)) : UsbAnswer::kStall;
                case UsbDescriptorType::kString:
                    if (number == 0) return answer(usb_languages());
                    return number <= d.strings.size() ? answer(encode_usb_string(d.strings[number - 1]))
                                                      : UsbAnswer::kStall;
                default: return UsbAnswer::kStall;
            }
        case UsbRequest::kGetStatus: return answer(std::array<std::uint8_t, 2>{});
        case UsbRequest::kGetConfiguration: return answer(std::array<std::uint8_t, 1>{1});
        case UsbRequest::kGetInterface: return answer(std::array<std::uint8_t, 1>{0});
        case UsbRequest::kSetConfiguration: return setup.value <= 1 ? 0 : UsbAnswer::kStall;
        case UsbRequest::kSetInterface: return setup.value == 0 ? device.control(setup, data) : UsbAnswer::kStall;
        case UsbRequest::kClearFeature: return setup.recipient() == 2 ? device.control(setup, data) : 0;
        case UsbRequest::kSetFeature: return 0;
        default: return UsbAnswer::kStall;
    }
}

}  // namespace narpa
