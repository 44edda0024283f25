// A USB camera's descriptors, negotiation and payload headers against the layout of the video class 1.0.
#include "protocols/usb/uvc.h"

#include <gtest/gtest.h>

#include <string>

#include "protocols/little_endian.h"
#include "protocols/usb/descriptors.h"

namespace narpa {
namespace {

using UvcBytes = std::vector<std::uint8_t>;

/// The class-specific descriptors of a subtype, in order.
std::vector<UvcBytes> uvc_descriptors(const UvcBytes& configuration, std::uint8_t subtype) {
    std::vector<UvcBytes> found;
    for (std::size_t at = 0; at < configuration.size(); at += configuration[at]) {
        const auto d = std::span(configuration).subspan(at, configuration[at]);
        if (d[1] == 0x24 && d[2] == subtype) found.emplace_back(d.begin(), d.end());
    }
    return found;
}

TEST(Uvc, AConfigurationHasTheFormatTheSizeAndTheRate) {
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv}) {
        const VideoFormat f{640, 480, pixel, 40'000'000};
        const UvcBytes c = uvc_configuration(f, true);
        const auto read = decode_usb_configuration(c);
        ASSERT_TRUE(read);
        ASSERT_EQ(read->interfaces.size(), 2u);
        EXPECT_EQ(read->interfaces[1].endpoints.at(0), (UsbEndpoint{0x81, 2, 512}));
        const auto format = uvc_descriptors(c, 4), frame = uvc_descriptors(c, 5);
        ASSERT_EQ(format.size(), 1u);
        ASSERT_EQ(frame.size(), 2u) << "the processing unit has the same number in the other interface";
        ASSERT_EQ(format[0].size(), 27u);
        const std::string code(format[0].begin() + 5, format[0].begin() + 9);
        EXPECT_EQ(code, pixel == PixelFormat::grey ? "Y800" : pixel == PixelFormat::y16 ? "Y16 " : "YUY2");
        EXPECT_EQ(format[0][21], 8 * bytes_per_pixel(pixel));
        ASSERT_EQ(frame[1].size(), 30u);
        EXPECT_EQ(get_le<std::uint16_t>(&frame[1][5]), 640);
        EXPECT_EQ(get_le<std::uint16_t>(&frame[1][7]), 480);
        EXPECT_EQ(get_le<std::uint32_t>(&frame[1][17]), frame_bytes(f));
        EXPECT_EQ(get_le<std::uint32_t>(&frame[1][26]), 400'000u) << "40 ms";
        // Both headers count what follows them.
        const auto header = uvc_descriptors(c, 1);
        EXPECT_EQ(get_le<std::uint16_t>(&header[0][5]), 13 + 18 + 11 + 9);
        EXPECT_EQ(get_le<std::uint16_t>(&header[1][4]), 14 + 27 + 30 + 6);
    }
    EXPECT_EQ(uvc_descriptors(uvc_configuration({64, 48}, true), 2)[0][15], 0x0a) << "exposure mode and time";
    EXPECT_EQ(uvc_descriptors(uvc_configuration({64, 48}, false), 2)[0][15], 0);
}

TEST(Uvc, AProbeIsReadAndWritten) {
    const UvcProbe p = uvc_probe({320, 240, PixelFormat::y16, 50'000'000});
    EXPECT_EQ(p.frame_bytes, 320u * 240 * 2);
    EXPECT_EQ(p.interval_100ns, 500'000u);
    const auto bytes = encode_uvc_probe(p);
    EXPECT_EQ(decode_uvc_probe(bytes), p);
    EXPECT_FALSE(decode_uvc_probe(std::span(bytes).first(25)));
}

TEST(Uvc, APayloadHeaderHasItsBytes) {
    const UvcPayloadHeader h{true, true, 0x01020304, 0x05060708, 0x7ff};
    std::array<std::uint8_t, kUvcHeaderBytes> b{};
    encode_uvc_header(h, b);
    EXPECT_EQ(b, (std::array<std::uint8_t, 12>{12, 0x8f, 4, 3, 2, 1, 8, 7, 6, 5, 0xff, 7}));
    EXPECT_EQ(decode_uvc_header(b), h);
    EXPECT_FALSE(decode_uvc_header(std::span(b).first(11)));
    b[1] = 0x80;
    EXPECT_FALSE(decode_uvc_header(b)) << "no time stamps";
    EXPECT_EQ(uvc_ticks(1'000'000'000), 48'000'000u);
}

}  // namespace
}  // namespace narpa
