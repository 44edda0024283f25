// Descriptors and control requests against bytes of the USB 2.0 specification.
#include "protocols/usb/descriptors.h"

#include <gtest/gtest.h>

#include <random>

namespace narpa {
namespace {

// GET_DESCRIPTOR(device), as every host begins; USB 2.0, 9.4.3.
constexpr std::array<std::uint8_t, 8> kGetDevice{0x80, 6, 0x00, 0x01, 0x00, 0x00, 0x12, 0x00};

TEST(UsbDescriptors, ASetupIsReadAndWritten) {
    const UsbSetup s = decode_usb_setup(kGetDevice);
    EXPECT_TRUE(s.to_host());
    EXPECT_EQ(s.kind(), 0);
    EXPECT_EQ(s.recipient(), 0);
    EXPECT_EQ(s.request, UsbRequest::kGetDescriptor);
    EXPECT_EQ(s.value, UsbDescriptorType::kDevice << 8);
    EXPECT_EQ(s.length, 18);
    std::array<std::uint8_t, 8> again{};
    encode_usb_setup(s, again);
    EXPECT_EQ(again, kGetDevice);
}

TEST(UsbDescriptors, ADeviceIsReadAndWritten) {
    // A candleLight's: 1d50:606f.
    const std::array<std::uint8_t, 18> bytes{18,   1,    0x00, 0x02, 0,    0, 0, 64, 0x50,
                                             0x1d, 0x6f, 0x60, 0x00, 0x01, 1, 2, 3,  1};
    const auto device = decode_usb_device(bytes);
    ASSERT_TRUE(device);
    EXPECT_EQ(device->vendor, 0x1d50);
    EXPECT_EQ(device->product, 0x606f);
    EXPECT_EQ(device->serial_string, 3);
    EXPECT_EQ(encode_usb_device(*device), bytes);
    EXPECT_FALSE(decode_usb_device(std::span(bytes).first(17)));
}

// One vendor interface with two bulk endpoints.
const std::vector<std::uint8_t> kAdapter{9,    2, 32, 0, 1,    1, 0,  0x80, 50, 9, 4, 0, 0, 2,  0xff, 0xff,
                                         0xff, 0, 7,  5, 0x81, 2, 64, 0,    0,  7, 5, 2, 2, 64, 0,    0};

TEST(UsbDescriptors, AConfigurationIsReadAndWritten) {
    const auto c = decode_usb_configuration(kAdapter);
    ASSERT_TRUE(c);
    ASSERT_EQ(c->interfaces.size(), 1u);
    const UsbInterface& i = c->interfaces[0];
    EXPECT_EQ(i.interface_class, 0xff);
    ASSERT_EQ(i.endpoints.size(), 2u);
    EXPECT_TRUE(i.endpoints[0].to_host() && i.endpoints[0].is_bulk());
    EXPECT_EQ(i.endpoints[1].address, 2);
    EXPECT_EQ(i.endpoints[1].max_packet, 64);
    const auto again = UsbConfigurationWriter(1, 100)
                           .interface({0, 0, 0xff, 0xff, 0xff}, 2)
                           .endpoint(i.endpoints[0])
                           .endpoint(i.endpoints[1])
                           .bytes();
    EXPECT_EQ(again, kAdapter);
}

TEST(UsbDescriptors, MalformedConfigurationsAreRefused) {
    const auto with = [](std::size_t at, std::uint8_t value) {
        auto bytes = kAdapter;
        bytes[at] = value;
        return bytes;
    };
    EXPECT_FALSE(decode_usb_configuration({}));
    EXPECT_FALSE(decode_usb_configuration(with(2, 33))) << "the whole length";
    EXPECT_FALSE(decode_usb_configuration(with(9, 0))) << "a length that never ends";
    EXPECT_FALSE(decode_usb_configuration(with(25, 8))) << "a length past the end";
    EXPECT_FALSE(decode_usb_configuration(with(13, 3))) << "an endpoint is missing";
    EXPECT_FALSE(decode_usb_configuration(with(13, 1))) << "an endpoint too many";
    EXPECT_FALSE(decode_usb_configuration(with(4, 2))) << "an interface is missing";
    std::mt19937 random(1);
    for (int n = 0; n < 20'000; ++n) {  // whatever comes, it ends
        auto bytes = kAdapter;
        for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
        (void)decode_usb_configuration(bytes);
    }
}

TEST(UsbDescriptors, TextsAreUtf16) {
    EXPECT_EQ(encode_usb_string("ab"), (std::vector<std::uint8_t>{6, 3, 'a', 0, 'b', 0}));
    EXPECT_EQ(encode_usb_string(std::string(300, 'x')).size(), 254u);
    EXPECT_EQ(usb_languages(), (std::vector<std::uint8_t>{4, 3, 9, 4}));
}

}  // namespace
}  // namespace narpa
