// gs_usb against bytes laid out by candleLight_fw's gs_usb.h, and mutated ones.
#include "protocols/usb/gs_usb.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace narpa {
namespace {

std::vector<std::uint8_t> gs_encoded(const GsUsbFrame& f, bool with_time) {
    std::array<std::uint8_t, kGsUsbFrameMostBytes> bytes{};
    const std::size_t n = encode_gs_usb_frame(f, with_time, bytes);
    return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n)};
}

TEST(GsUsb, AClassicFrameHasItsBytes) {
    GsUsbFrame f;
    f.echo = 3;
    f.frame.id = 0x18ff50e5, f.frame.extended = true, f.frame.size = 2;
    f.frame.data[0] = 0xde, f.frame.data[1] = 0xad;
    const std::vector<std::uint8_t> wanted{3, 0, 0,    0,    0xe5, 0x50, 0xff, 0x98, 2, 0,
                                           0, 0, 0xde, 0xad, 0,    0,    0,    0,    0, 0};
    EXPECT_EQ(gs_encoded(f, false), wanted);
    const auto back = decode_gs_usb_frame(wanted, false);
    ASSERT_TRUE(back);
    EXPECT_EQ(back->echo, 3u);
    EXPECT_TRUE(back->frame.extended && !back->frame.fd && !back->frame.remote);
    EXPECT_EQ(back->frame.id, 0x18ff50e5u);
    EXPECT_EQ(back->frame.data, f.frame.data);
}

TEST(GsUsb, AFrameOfCanFdHasItsBytesAndItsTime) {
    GsUsbFrame f;
    f.channel = 1;
    f.frame.id = 0x123, f.frame.fd = f.frame.bit_rate_switch = true, f.frame.size = 13;
    f.frame.data.fill(0), f.frame.data[12] = 7;
    f.time_us = 0x01020304;
    const auto bytes = gs_encoded(f, true);
    ASSERT_EQ(bytes.size(), 80u);
    EXPECT_EQ(bytes[0], 0xff);
    EXPECT_EQ(bytes[8], 10) << "the code of 16 bytes";
    EXPECT_EQ(bytes[9], 1);
    EXPECT_EQ(bytes[10], 2 | 4);
    EXPECT_EQ(bytes[76], 4);
    EXPECT_EQ(bytes[79], 1);
    const auto back = decode_gs_usb_frame(bytes, true);
    ASSERT_TRUE(back);
    EXPECT_EQ(back->frame.size, 16);
    EXPECT_EQ(back->frame.data[12], 7);
    EXPECT_EQ(back->time_us, 0x01020304u);
}

TEST(GsUsb, ErrorReportsKeepTheirClass) {
    GsUsbFrame f;
    f.frame.error = true, f.frame.id = CanErrorClass::kBusOff, f.frame.size = 8;
    const auto back = decode_gs_usb_frame(gs_encoded(f, true), true);
    ASSERT_TRUE(back);
    EXPECT_TRUE(back->frame.error);
    EXPECT_EQ(back->frame.id, CanErrorClass::kBusOff);
}

TEST(GsUsb, MalformedFramesAreRefused) {
    GsUsbFrame f;
    f.frame.size = 8;
    const auto good = gs_encoded(f, false);
    const auto with = [&](std::size_t at, std::uint8_t value) {
        auto bytes = good;
        bytes[at] = value;
        return decode_gs_usb_frame(bytes, false);
    };
    for (std::size_t n = 0; n < good.size(); ++n)
        EXPECT_FALSE(decode_gs_usb_frame(std::span(good).first(n), false));
    EXPECT_FALSE(decode_gs_usb_frame(std::vector<std::uint8_t>(81), false)) << "too long";
    EXPECT_FALSE(decode_gs_usb_frame(good, true)) << "no time behind it";
    EXPECT_FALSE(with(8, 9)) << "nine bytes";
    EXPECT_FALSE(with(10, 2)) << "too short for CAN FD";
    std::mt19937 random(3);
    for (int n = 0; n < 50'000; ++n) {
        auto bytes = good;
        bytes.resize(random() % 100);
        for (int k = 0; k < 4 && !bytes.empty(); ++k)
            bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
        const auto any = decode_gs_usb_frame(bytes, n % 2 == 0);
        if (!any) continue;
        ASSERT_LE(any->frame.size, any->frame.fd ? 64 : 8);
        ASSERT_FALSE(any->frame.fd && any->frame.remote);
        ASSERT_LE(any->frame.id, any->frame.extended || any->frame.error ? 0x1fffffffu : 0x7ffu);
    }
}

TEST(GsUsb, ControlMessagesAreReadAndWritten) {
    const std::vector<std::uint8_t> config{0, 0, 0, 1, 2, 0, 0, 0, 1, 0, 0, 0};
    EXPECT_EQ(decode_gs_usb_config(config), (GsUsbConfig{2, 2, 1}));
    EXPECT_FALSE(decode_gs_usb_config(std::span(config).first(11)));

    GsUsbLimits limits{GsUsbFeature::kFd, 80'000'000, {1, 256, 1, 128, 128, 1, 512, 1}, BitTimingRange{}};
    std::array<std::uint8_t, kGsUsbLimitsFdBytes> bytes{};
    EXPECT_EQ(encode_gs_usb_limits(limits, bytes), 72u);
    EXPECT_EQ(decode_gs_usb_limits(bytes), limits);
    limits.data.reset();
    EXPECT_EQ(encode_gs_usb_limits(limits, bytes), 40u);
    EXPECT_EQ(decode_gs_usb_limits(std::span(bytes).first(40)), limits);
    bytes[4] = bytes[5] = bytes[6] = bytes[7] = 0;
    EXPECT_FALSE(decode_gs_usb_limits(std::span(bytes).first(40))) << "no clock";

    const BitTiming timing{6, 7, 2, 1, 6};
    EXPECT_EQ(decode_gs_usb_bit_timing(encode_gs_usb_bit_timing(timing)), timing);
    EXPECT_FALSE(decode_gs_usb_bit_timing(encode_gs_usb_bit_timing({})));
    EXPECT_EQ(decode_gs_usb_mode(encode_gs_usb_mode({true, 0x110})), (GsUsbMode{true, 0x110}));
    EXPECT_FALSE(decode_gs_usb_mode(std::vector<std::uint8_t>{2, 0, 0, 0, 0, 0, 0, 0}));
}

TEST(GsUsb, BitTimingIsExactAndItsSamplePointIsTheRecommendedOne) {
    // A candleLight's: 48 MHz, segments up to 16 and 8 quanta.
    const BitTimingRange can{1, 16, 1, 8, 4, 1, 1024, 1};
    for (const std::uint32_t rate : {10'000u, 50'000u, 125'000u, 250'000u, 500'000u, 800'000u, 1'000'000u}) {
        const auto t = bit_timing_of(rate, 48'000'000, can);
        ASSERT_TRUE(t) << rate;
        EXPECT_EQ(48'000'000 / t->brp / t->quanta(), rate);
        EXPECT_EQ(48'000'000 % (t->brp * t->quanta()), 0u);
        EXPECT_LE(t->prop_seg + t->phase_seg1, 16u);
        EXPECT_LE(t->phase_seg2, 8u);
        const double sample_point = 1 - static_cast<double>(t->phase_seg2) / t->quanta();
        EXPECT_NEAR(sample_point, rate > 800'000 ? 0.75 : rate > 500'000 ? 0.8 : 0.875, 0.02) << rate;
    }
    EXPECT_FALSE(bit_timing_of(0, 48'000'000, can));
    EXPECT_FALSE(bit_timing_of(999'999, 48'000'000, can)) << "48 MHz cannot be divided so";
    EXPECT_FALSE(bit_timing_of(48'000'000, 48'000'000, can)) << "a bit has three quanta";
    EXPECT_TRUE(bit_timing_of(5'000'000, 80'000'000, {1, 32, 1, 16, 16, 1, 32, 1}));
}

}  // namespace
}  // namespace narpa
