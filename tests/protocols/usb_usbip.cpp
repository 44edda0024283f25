// USB/IP against bytes that the kernel's documentation gives (Documentation/usb/usbip_protocol.rst), and mutated
// ones.
#include "protocols/usb/usbip.h"

#include <gtest/gtest.h>

#include <random>

namespace narpa {
namespace {

using UsbIpHeader = std::array<std::uint8_t, kUsbIpHeaderBytes>;

// The document's example: 64 bytes are asked of endpoint 1, which is interrupt in.
constexpr UsbIpHeader kSubmitIn{0, 0, 0, 1, 0, 0, 0x0d, 0x05, 0, 1, 0, 0x0f, 0,    0,    0,    1,
                                0, 0, 0, 1, 0, 0, 2,    0,    0, 0, 0, 0x40, 0xff, 0xff, 0xff, 0xff,
                                0, 0, 0, 0, 0, 0, 0,    4,    0, 0, 0, 0,    0,    0,    0,    0};
constexpr UsbIpHeader kSubmitted{0, 0, 0, 3,    0, 0, 0x0d, 0x05, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
                                 0, 0, 0, 0x40, 0, 0, 0,    0,    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};

TEST(UsbIp, ReadsTheExampleOfTheKernelsDocument) {
    const auto request = decode_usbip_request(kSubmitIn);
    ASSERT_TRUE(request);
    const auto& submit = std::get<UsbIpSubmit>(*request);
    EXPECT_EQ(submit.sequence, 0xd05u);
    EXPECT_EQ(submit.endpoint, 1);
    EXPECT_TRUE(submit.to_host);
    EXPECT_EQ(submit.length, 64u);
    const auto reply = decode_usbip_reply(kSubmitted);
    ASSERT_TRUE(reply);
    EXPECT_EQ(*reply, (UsbIpReply{false, 0xd05, 0, 64}));
    UsbIpHeader again{};
    encode_usbip_reply(*reply, again);
    EXPECT_EQ(again, kSubmitted);
}

TEST(UsbIp, WhatIsWrittenIsRead) {
    UsbIpHeader bytes{};
    const UsbSetup setup{0x21, 1, 0x0200, 1, 26};
    for (const UsbIpRequest& r :
         {UsbIpRequest(UsbIpSubmit{7, 0, false, 26, setup}), UsbIpRequest(UsbIpUnlink{8, 7})}) {
        encode_usbip_request(r, bytes);
        EXPECT_EQ(decode_usbip_request(bytes), r);
    }
    for (const UsbIpReply& r : {UsbIpReply{true, 8, -104, 0}, UsbIpReply{false, 7, -32, 0}}) {
        encode_usbip_reply(r, bytes);
        EXPECT_EQ(decode_usbip_reply(bytes), r);
    }
}

TEST(UsbIp, RefusesWhatItCannotFollow) {
    const auto with = [](std::size_t at, std::uint8_t value) {
        UsbIpHeader bytes = kSubmitIn;
        bytes[at] = value;
        return decode_usbip_request(bytes);
    };
    EXPECT_FALSE(with(3, 5)) << "no such command";
    EXPECT_FALSE(with(15, 2)) << "a third direction";
    EXPECT_FALSE(with(19, 16)) << "endpoint 16";
    EXPECT_FALSE(with(24, 0x10)) << "a quarter of a GiB";
    EXPECT_FALSE(with(35, 3)) << "isochronous";
    std::mt19937 random(2);
    for (int n = 0; n < 20'000; ++n) {
        UsbIpHeader bytes = kSubmitIn;
        for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
        const auto request = decode_usbip_request(bytes);
        if (!request || !std::holds_alternative<UsbIpSubmit>(*request)) continue;
        ASSERT_LE(std::get<UsbIpSubmit>(*request).length, kUsbIpLongestTransfer);
        ASSERT_LT(std::get<UsbIpSubmit>(*request).endpoint, 16);
    }
}

TEST(UsbIp, ListsAndImportsHaveTheirPlaces) {
    UsbIpDevice d{"/sys/x", "1-1", 1, 2, UsbSpeed::high, {}, {}};
    d.device.vendor = 0x1d50, d.device.product = 0x606f;
    d.configuration.interfaces = {{0, 0, 0x0e, 1, 0}, {1, 0, 0x0e, 2, 0}};
    const auto list = encode_usbip_list({&d, 1});
    ASSERT_EQ(list.size(), 8u + 4 + 312 + 2 * 4);
    EXPECT_EQ(list[11], 1) << "one device";
    EXPECT_EQ(list[12 + 299], 3) << "its speed";
    EXPECT_EQ(list[12 + 311], 2) << "its interfaces";
    EXPECT_EQ(list[12 + 312 + 5], 2) << "the subclass of the second";
    const auto import = encode_usbip_import(d);
    ASSERT_EQ(import.size(), 8u + 312);
    EXPECT_TRUE(std::equal(import.begin() + 8, import.end(), list.begin() + 12));
    EXPECT_EQ(decode_usbip_op(std::span(import).first<8>()), (UsbIpOpHeader{UsbIpOp::import_reply, 0}));

    std::array<std::uint8_t, 32> bus_id{'1', '-', '1'};
    EXPECT_EQ(decode_usbip_bus_id(bus_id), "1-1");
    bus_id.fill('x');
    EXPECT_FALSE(decode_usbip_bus_id(bus_id)) << "no end";
    EXPECT_FALSE(decode_usbip_op(std::array<std::uint8_t, 8>{0x01, 0x10, 0x80, 0x05})) << "another version";
    EXPECT_FALSE(decode_usbip_op(std::array<std::uint8_t, 8>{0x01, 0x11, 0x80, 0x06})) << "another operation";
}

}  // namespace
}  // namespace narpa
