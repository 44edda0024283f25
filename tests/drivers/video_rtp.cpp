// Frames in RTP packets: from the sink rtp: to the source rtp:, on the loopback.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include "drivers/video/video_sink.h"
#include "drivers/video/video_source.h"
#include "protocols/big_endian.h"
#include "protocols/video/rtp_video.h"
#include "tests/drivers/video_support.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Bytes, test::noise_frame, test::OwnPort;

constexpr VideoFormat kRtpFrames{64, 48, PixelFormat::y16, 100'000'000};
constexpr std::int64_t kArrival_ns = 60'000'000'000;

std::unique_ptr<VideoSink> rtp_to(const std::string& port_and_options, const VideoFormat& format) {
    auto sink = open_video_sink("rtp:127.0.0.1:" + port_and_options, format, WhenFull::wait);
    EXPECT_TRUE(sink) << sink.error().text();
    return sink ? std::move(*sink) : nullptr;
}
std::unique_ptr<VideoSource> rtp_at(const std::string& port, const VideoFormat& format) {
    auto source = open_video_source("rtp:127.0.0.1:" + port, format);
    EXPECT_TRUE(source) << source.error().text();
    return source ? std::move(*source) : nullptr;
}

TEST(RtpSink, FramesArriveAsTheyWereSent) {
    std::vector<VideoFormat> formats;
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::rgb24, PixelFormat::yuyv})
        formats.push_back({64, 48, pixel, 100'000'000});
    for (const LinkFormatRow& row : kLinkFormats)
        if (is_mono(row.samples)) formats.push_back({64, 48, row.samples, 100'000'000, row.layout});
    for (const VideoFormat& format : formats)
        for (const char* options : {"", ",mtu=128", ",mtu=65535,mbit_s=10000"}) {
            const std::string port = OwnPort().release();
            const auto source = rtp_at(port + options, format);
            const auto sink = rtp_to(port + options, format);
            ASSERT_TRUE(source && sink);
            Bytes came(frame_bytes(format));
            const unsigned lost = (1u << (16 - format.link.bits)) - 1;  // below the ADC's bits
            for (std::uint32_t k = 0; k < 3; ++k) {
                Bytes frame = noise_frame(format, k);
                for (std::size_t i = 0; i < frame.size() && lost > 0; i += 2)
                    frame[i] &= static_cast<std::uint8_t>(~lost);
                ASSERT_TRUE(sink->send(frame, {.t_ns = k * 100'000'000, .number = k}));
                ASSERT_TRUE(source->receive(came, kArrival_ns)) << link_name(format.pixel, format.link) << options;
                EXPECT_TRUE(came == frame) << link_name(format.pixel, format.link) << options;
            }
            sink->flush();
            EXPECT_EQ(sink->counters().written, 3u);
            EXPECT_EQ(source->counters().received, 3u);
            EXPECT_EQ(source->counters().truncated + source->counters().lost, 0u);
        }
}

TEST(RtpSink, PacketsFitTheMtuAndNameTheFrame) {
    const OwnPort port;
    const auto sink = rtp_to(port.text() + ",mtu=1000", kRtpFrames);
    ASSERT_TRUE(sink);
    ASSERT_TRUE(sink->send(noise_frame(kRtpFrames, 1), {.t_ns = 1'000'000'000, .number = 17}));
    std::uint16_t next = 0;
    for (bool is_last = false; !is_last; ++next) {
        Bytes packet(65536);
        const ssize_t n = ::recv(port.fd(), packet.data(), packet.size(), 0);
        ASSERT_GT(n, 0);
        EXPECT_LE(n, 1000 - 28);
        is_last = (packet[1] & 0x80) != 0;
        EXPECT_EQ(get_be<std::uint16_t>(&packet[2]), next);
        EXPECT_EQ(get_be<std::uint32_t>(&packet[4]), 90'000u);
        EXPECT_EQ(get_be<std::uint64_t>(&packet[17]), 1'000'000'000u);
        EXPECT_EQ(get_be<std::uint32_t>(&packet[25]), 17u);
    }
    EXPECT_EQ(next, 16u) << "48 rows of 64 pixels of 4 bytes, three in a packet";
}

TEST(RtpSink, WritesTheSdpFile) {
    const test::TemporaryFolder folder;
    const std::string file = folder / "camera.sdp", port = OwnPort().release();
    const auto sink = rtp_to(port + ",sdp=" + file + ",mtu=9000", kRtpFrames);
    ASSERT_TRUE(sink);
    const std::string sdp = test::read_text(file);
    EXPECT_NE(sdp.find("c=IN IP4 127.0.0.1\r\n"), std::string::npos) << sdp;
    EXPECT_NE(sdp.find("m=video " + port + " RTP/AVP 96\r\n"), std::string::npos) << sdp;
    EXPECT_NE(sdp.find("sampling=YCbCr-4:2:2; width=64; height=48; depth=16;"), std::string::npos) << sdp;
    EXPECT_NE(sink->description().find("ffplay -protocol_whitelist file,udp,rtp " + file), std::string::npos);
    EXPECT_NE(sink->description().find("port " + port + ", at 1000 Mbit/s"), std::string::npos);
}

TEST(RtpSink, CountsFramesThatNobodyReceives) {
    const auto sink = rtp_to(OwnPort().release(), kRtpFrames);
    ASSERT_TRUE(sink);
    for (std::uint32_t k = 0; k < 4; ++k) {
        EXPECT_TRUE(sink->send(noise_frame(kRtpFrames, k), {.number = k}));
        sink->flush();
    }
    EXPECT_GE(sink->counters().no_reader, 3u);
    EXPECT_EQ(sink->counters().failed, 0u);
}

TEST(RtpSource, NamesFramesOfAnotherFormat) {
    const std::string port = OwnPort().release();
    const auto source = rtp_at(port, kRtpFrames);
    const VideoFormat other{32, 16, PixelFormat::grey, 100'000'000};
    const auto sink = rtp_to(port, other);
    ASSERT_TRUE(source && sink);
    ASSERT_TRUE(sink->send(noise_frame(other, 0), {}));
    Bytes came(frame_bytes(kRtpFrames));
    EXPECT_FALSE(source->receive(came, kArrival_ns));
    ASSERT_FALSE(source->status());
    EXPECT_NE(source->status().error().what.find("not of 64 x 48 YCbCr-4:2:2 of 16 bits"), std::string::npos)
        << source->status().error().what;
}

TEST(RtpSink, BadTextsGetErrorsThatSayWhatIsExpected) {
    for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
             {"rtp:", "expected rtp:HOST:PORT"},
             {"rtp:5004", "expected rtp:HOST:PORT, as in rtp:192.168.1.70:5004"},
             {"rtp:127.0.0.1:0", "expected rtp:HOST:PORT"},
             {"rtp:127.0.0.1:70000", "expected rtp:HOST:PORT"},
             {"rtp:127.0.0.1:5004,",
              "rtp:127.0.0.1:5004,: expected nothing after the port but ,ttl=N, from 0 to 255 or "
              ",mtu=N, from 128 to 65535 or ,mbit_s=N, from 1 to 100000 or ,sdp=FILE"},
             {"rtp:127.0.0.1:5004,sdp=", ",sdp=FILE"},
             {"rtp:127.0.0.1:5004,sdp", ",sdp=FILE"},
             {"rtp:127.0.0.1:5004,sdpx=a.sdp", ",sdp=FILE"},
             {"rtp:127.0.0.1:5004,mtu=127", ",mtu=N, from 128 to 65535"},
             {"rtp:127.0.0.1:5004,mbit_s=1", "expected ,mbit_s=113 or more"},
             {"rtp:127.0.0.1%:5004", "rtp:127.0.0.1%:5004: expected an interface after %"},
             {"rtp:no.such.host.invalid:5004", "unknown host"}}) {
        const VideoFormat format{1600, 400, PixelFormat::grey, 100'000'000};
        const auto sink = open_video_sink(text, format, WhenFull::drop);
        ASSERT_FALSE(sink) << text;
        EXPECT_NE(sink.error().text().find(expected), std::string::npos) << sink.error().text();
    }
    for (const char* text : {"rtp:0", "rtp:127.0.0.1", "rtp:127.0.0.1:70000"}) {
        const auto source = open_video_source(text, kRtpFrames);
        ASSERT_FALSE(source) << text;
        EXPECT_NE(source.error().text().find("expected rtp:PORT or rtp:ADDRESS:PORT"), std::string::npos)
            << source.error().text();
    }
    const auto mosaic = open_video_source("rtp:5004", {64, 48, PixelFormat::rggb8, 100'000'000});
    ASSERT_FALSE(mosaic);
    EXPECT_NE(mosaic.error().text().find("no mosaics"), std::string::npos);
}

}  // namespace
}  // namespace narpa
