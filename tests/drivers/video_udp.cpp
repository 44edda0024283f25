// Frames in datagrams: from the sink udp: to the source udp:, on the loopback.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include "base/time.h"
#include "drivers/video/video_sink.h"
#include "drivers/video/video_source.h"
#include "protocols/video/frame_datagram.h"
#include "tests/drivers/video_support.h"

namespace narpa {
namespace {

using test::Bytes, test::noise_frame, test::OwnPort;

constexpr VideoFormat kSmallFrames{64, 48, PixelFormat::y16, 100'000'000};
constexpr std::int64_t kSoon_ns = 60'000'000'000;

std::unique_ptr<VideoSink> frames_to(const std::string& port_and_options, const VideoFormat& format) {
    auto sink = open_video_sink("udp:127.0.0.1:" + port_and_options, format, WhenFull::wait);
    EXPECT_TRUE(sink) << sink.error().text();
    return sink ? std::move(*sink) : nullptr;
}
std::unique_ptr<VideoSource> frames_at(const std::string& port, const VideoFormat& format) {
    auto source = open_video_source("udp:127.0.0.1:" + port, format);
    EXPECT_TRUE(source) << source.error().text();
    return source ? std::move(*source) : nullptr;
}

TEST(UdpVideo, FramesArriveAsTheyWereSent) {
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::rgb24, PixelFormat::bggr16})
        for (const char* options : {"", ",mtu=128", ",mtu=9000,mbit_s=10000", ",mtu=65535,ttl=3"}) {
            const VideoFormat format{64, 48, pixel, 100'000'000};
            const std::string port = OwnPort().release();
            const auto source = frames_at(port + options, format);
            const auto sink = frames_to(port + options, format);
            ASSERT_TRUE(source && sink);
            Bytes came(frame_bytes(format));
            for (std::uint32_t k = 0; k < 3; ++k) {
                const Bytes frame = noise_frame(format, k);
                ASSERT_TRUE(sink->send(frame, {.t_ns = k * 100, .number = k}));
                ASSERT_TRUE(source->receive(came, kSoon_ns)) << name(pixel) << options;
                EXPECT_TRUE(came == frame) << name(pixel) << options;
            }
            sink->flush();
            EXPECT_EQ(sink->counters().written, 3u);
            EXPECT_EQ(source->counters().received, 3u);
            EXPECT_EQ(source->counters().truncated + source->counters().lost, 0u);
        }
}

/// Both ends lay the pixels out and back; the bits below the ADC's are lost on the way.
TEST(UdpVideo, CarriesEveryLayoutOfPixels) {
    for (LinkFormatRow row : kLinkFormats) {
        if (row.v4l2.empty()) {  // GenICam's
            const auto refused =
                open_video_sink("udp:127.0.0.1:5004", {64, 48, row.samples, 1, row.layout}, WhenFull::drop);
            ASSERT_FALSE(refused) << row.name;
            EXPECT_NE(refused.error().what.find("V4L2 has no code of " + std::string(row.name)), std::string::npos);
            continue;
        }
        row.layout.big_endian = !row.layout.is_packed();
        row.layout.row_bytes = 160;  // at most 128 are pixels
        const VideoFormat format{64, 48, row.samples, 100'000'000, row.layout};
        const std::string port = OwnPort().release();
        const auto source = frames_at(port, format);
        const auto sink = frames_to(port, format);
        ASSERT_TRUE(source && sink);
        Bytes frame = noise_frame(format, 1), came(frame_bytes(format));
        const unsigned lost = (1u << (16 - row.layout.bits)) - 1;
        for (std::size_t i = 0; i < frame.size(); i += 2) {
            frame[i] &= static_cast<std::uint8_t>(~lost);
        }
        ASSERT_TRUE(sink->send(frame, {.number = 1}));
        ASSERT_TRUE(source->receive(came, kSoon_ns)) << row.name;
        EXPECT_TRUE(came == frame) << row.name;
    }
    const VideoFormat odd{62, 48, PixelFormat::y16, 100'000'000, {LinkLayout::Kind::mipi, 10}};
    EXPECT_FALSE(open_video_sink("none", odd, WhenFull::drop));
    EXPECT_FALSE(open_video_source("udp:" + OwnPort().release(), odd));
    const VideoFormat packed{64, 48, PixelFormat::y16, 100'000'000, {LinkLayout::Kind::mipi, 12}};
    for (const char* sink : {"uvc:0", "tcp:0"}) {
        const auto refused = open_video_sink(sink, packed, WhenFull::drop);
        ASSERT_FALSE(refused) << sink;
        EXPECT_NE(refused.error().text().find("Y12P"), std::string::npos) << refused.error().text();
    }
}

TEST(UdpVideo, DatagramsFitTheMtu) {
    const OwnPort port;
    const auto sink = frames_to(port.text() + ",mtu=1000", kSmallFrames);
    ASSERT_TRUE(sink);
    ASSERT_TRUE(sink->send(noise_frame(kSmallFrames, 1), {.t_ns = -5, .number = 17}));
    std::uint32_t count = 1;
    for (std::uint32_t i = 0; i < count; ++i) {
        Bytes datagram(65536);
        const ssize_t n = ::recv(port.fd(), datagram.data(), datagram.size(), 0);
        ASSERT_GT(n, 0);
        EXPECT_LE(n, 1000 - 28);
        const auto header = decode_frame_datagram(std::span(datagram).first(static_cast<std::size_t>(n)));
        ASSERT_TRUE(header);
        EXPECT_EQ(header->index, i);
        EXPECT_EQ(header->row, 7 * i) << "as many rows as fit";
        EXPECT_EQ(header->frame, 17u);
        EXPECT_EQ(header->t_ns, -5);
        count = header->count;
    }
    EXPECT_EQ(count, 7u) << "48 rows of 128 bytes, seven in a datagram";
}

/// The rate is an upper bound: nothing can make a slow machine fast.
TEST(UdpVideo, LeavesNoFasterThanItsRate) {
    const VideoFormat format{640, 480, PixelFormat::grey, 1'000'000'000};
    const std::string port = OwnPort().release();
    const auto source = frames_at(port, format);
    const auto sink = frames_to(port + ",mbit_s=20", format);
    ASSERT_TRUE(source && sink);
    Bytes came(frame_bytes(format));
    const std::int64_t begin_ns = monotonic_ns();
    ASSERT_TRUE(sink->send(noise_frame(format, 0), {}));
    ASSERT_TRUE(source->receive(came, kSoon_ns));
    EXPECT_GT(monotonic_ns() - begin_ns, 120'000'000) << "2.5 Mbit at 20 Mbit/s";
}

TEST(UdpVideo, CountsFramesThatNobodyReceives) {
    const auto sink = frames_to(OwnPort().release(), kSmallFrames);
    ASSERT_TRUE(sink);
    // The refusal of the first frame is known when the second datagram is sent.
    for (std::uint32_t k = 0; k < 4; ++k) {
        EXPECT_TRUE(sink->send(noise_frame(kSmallFrames, k), {.number = k}));
        sink->flush();
    }
    EXPECT_GE(sink->counters().no_reader, 3u);
    EXPECT_EQ(sink->counters().failed, 0u);
}

TEST(UdpVideo, SourceNamesAnotherFormat) {
    const std::string port = OwnPort().release();
    const auto source = frames_at(port, kSmallFrames);
    const VideoFormat other{32, 16, PixelFormat::grey, 100'000'000};
    const auto sink = frames_to(port, other);
    ASSERT_TRUE(source && sink);
    ASSERT_TRUE(sink->send(noise_frame(other, 0), {}));
    Bytes came(frame_bytes(kSmallFrames));
    EXPECT_FALSE(source->receive(came, kSoon_ns));
    ASSERT_FALSE(source->status());
    EXPECT_NE(source->status().error().what.find("32 x 16 GREY"), std::string::npos);
}

TEST(UdpVideo, BadTextsGetErrorsThatSayWhatIsExpected) {
    for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
             {"udp:", "expected udp:HOST:PORT"},
             {"udp:5004", "expected udp:HOST:PORT"},
             {"udp:127.0.0.1:0", "expected udp:HOST:PORT"},
             {"udp:127.0.0.1:70000", "expected udp:HOST:PORT"},
             {"udp:127.0.0.1:5004,", "expected nothing after the port but ,ttl=N, from 0 to 255 or ,mtu=N"},
             {"udp:127.0.0.1:5004,mtu=127", ",mtu=N, from 128 to 65535"},
             {"udp:127.0.0.1:5004,mtu", ",mtu=N, from 128 to 65535"},
             {"udp:127.0.0.1:5004,mtu=1500,mbit_s=0", ",mbit_s=N, from 1 to 100000"},
             {"udp:127.0.0.1:5004,mbit_s=1", "expected ,mbit_s=59 or more"},
             {"udp:no.such.host.invalid:5004", "unknown host"}}) {
        const VideoFormat format{1600, 400, PixelFormat::grey, 100'000'000};
        const auto sink = open_video_sink(text, format, WhenFull::drop);
        ASSERT_FALSE(sink) << text;
        EXPECT_NE(sink.error().text().find(expected), std::string::npos) << sink.error().text();
    }
    EXPECT_FALSE(open_video_source("udp:0", kSmallFrames));
    EXPECT_FALSE(open_video_source("udp:127.0.0.1", kSmallFrames));
}

}  // namespace
}  // namespace narpa
