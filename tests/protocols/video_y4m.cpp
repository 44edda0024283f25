#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "protocols/video/y4m.h"

namespace narpa {
namespace {

std::string header(int w, int h, PixelFormat pixel, std::int64_t period_ns) {
    const Result<std::string> text = y4m_stream_header({w, h, pixel, period_ns});
    return text ? *text : "error: " + text.error().what;
}

TEST(Y4m, StreamHeaderHasSizeExactRateAndColourSpace) {
    EXPECT_EQ(header(640, 480, PixelFormat::grey, 100'000'000), "YUV4MPEG2 W640 H480 F10:1 Ip A1:1 Cmono\n");
    EXPECT_EQ(header(8, 2, PixelFormat::y16, 40'000'000), "YUV4MPEG2 W8 H2 F25:1 Ip A1:1 Cmono16\n");
    EXPECT_EQ(header(8, 2, PixelFormat::yuyv, 16'666'667), "YUV4MPEG2 W8 H2 F1000000000:16666667 Ip A1:1 C422\n");
    EXPECT_EQ(header(1, 1, PixelFormat::grey, 2'000'000'000), "YUV4MPEG2 W1 H1 F1:2 Ip A1:1 Cmono\n");
}

TEST(Y4m, ErrorNamesTheFormatsThatItHolds) {
    EXPECT_EQ(header(8, 2, PixelFormat::rgb24, 1),
              "error: Y4M cannot hold frames of RGB24; it holds GREY, Y10, Y12, Y16 and YUYV");
    EXPECT_EQ(header(8, 2, PixelFormat::grbg8, 1),
              "error: Y4M cannot hold frames of GRBG8; it holds GREY, Y10, Y12, Y16 and YUYV");
    EXPECT_EQ(header(7, 2, PixelFormat::yuyv, 1), "error: YUYV needs an even width, not 7");
    EXPECT_EQ(header(0, 2, PixelFormat::grey, 1), "error: Y4M needs a positive width, height and frame period");
    EXPECT_EQ(header(8, 2, PixelFormat::grey, 0), "error: Y4M needs a positive width, height and frame period");
}

TEST(Y4m, YuyvBecomesThreePlanes) {
    const VideoFormat format{4, 1, PixelFormat::yuyv, 1};
    const std::vector<std::uint8_t> frame{'a', 'U', 'b', 'V', 'c', 'u', 'd', 'v'};
    std::vector<std::uint8_t> samples(8);
    y4m_samples(format, frame, samples);
    EXPECT_EQ(samples, (std::vector<std::uint8_t>{'a', 'b', 'c', 'd', 'U', 'u', 'V', 'v'}));
}

TEST(Y4m, HeadersThatStateOtherFramesAreNamed) {
    const VideoFormat format{8, 2, PixelFormat::grey, 40'000'000};
    EXPECT_TRUE(check_y4m_stream_header("YUV4MPEG2 W8 H2 F25:1 Ip A1:1 Cmono", format));
    EXPECT_TRUE(check_y4m_stream_header("YUV4MPEG2 W8 H2 F25:1 Cmono XCOLORRANGE=FULL", format));
    const auto error_of = [&](const char* line) {
        const Status good = check_y4m_stream_header(line, format);
        return good ? "" : good.error().what;
    };
    EXPECT_NE(error_of("YUV4MPEG2 W8 H2 F25:1 Ip A1:1 Cmono\r").find("ends in a carriage return"),
              std::string::npos);
    EXPECT_NE(error_of("YUV4MPEG2 W8 H2 F25:1 It A1:1 Cmono").find("interlaced (It)"), std::string::npos);
}

TEST(Y4m, NoSampleIsLost) {
    std::mt19937_64 random(11);
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv}) {
        const VideoFormat format{34, 7, pixel, 1};
        std::vector<std::uint8_t> frame(frame_bytes(format)), samples(frame.size()), back(frame.size());
        for (auto& x : frame) x = static_cast<std::uint8_t>(random());
        y4m_samples(format, frame, samples);
        frame_from_y4m(format, samples, back);
        EXPECT_EQ(back, frame) << name(pixel);
        EXPECT_EQ(samples == frame, y4m_is_verbatim(pixel));
    }
}

}  // namespace
}  // namespace narpa
