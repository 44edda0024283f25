// Uncompressed video in RTP packets: bytes worked out from RFC 3550, 4175 and 8285, and what comes out of a stream.
#include "protocols/video/rtp_video.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "protocols/big_endian.h"

namespace narpa {
namespace {

using RtpBytes = std::vector<std::uint8_t>;
using RtpPackets = std::vector<RtpBytes>;

constexpr std::size_t kBeforeRows = 12 + 20 + 2;  // RTP, its extension, the extended sequence number
constexpr std::uint32_t kSource = 0xA1B2C3D4;

VideoFormat link_format(std::string_view name, int width, int height) {
    for (const LinkFormatRow& row : kLinkFormats)
        if (row.name == name) return {width, height, row.samples, 100'000'000, row.layout};
    return {width, height, *pixel_format_from(name), 100'000'000};
}

RtpVideoPackets packets_of(const VideoFormat& format, std::size_t packet_bytes) {
    return {format, *rtp_sampling(format), packet_bytes, kSource};
}

RtpPackets frame_packets(RtpVideoPackets& packets, const RtpBytes& frame, std::uint32_t number) {
    RtpPackets out;
    for (std::uint32_t i = 0; i < packets.count(); ++i) {
        const auto packet = packets.next(frame, std::int64_t{number} * 100'000'000 + 75'000, number, i);
        out.emplace_back(packet.begin(), packet.end());
    }
    return out;
}

/// Samples with the bits of the format, left-justified; the others are 0.
RtpBytes noise(const VideoFormat& format, std::uint32_t seed) {
    std::mt19937 random(seed);
    RtpBytes frame(frame_bytes(format));
    for (auto& byte : frame) byte = static_cast<std::uint8_t>(random());
    if (const std::size_t depth = rtp_sampling(format)->depth; depth == 10 || depth == 12)
        for (std::size_t i = 0; i < frame.size(); i += 2) frame[i] &= depth == 10 ? 0xC0 : 0xF0;
    return frame;
}

TEST(RtpVideo, APacketHasTheHeadersOfTheStandards) {
    const VideoFormat format{4, 3, PixelFormat::grey, 100'000'000};
    RtpVideoPackets packets = packets_of(format, 64);  // two rows: 34 + 2 * (6 + 8) = 62
    ASSERT_EQ(packets.count(), 2u);
    EXPECT_EQ(packets.frame_packets_bytes(), 62u + 48u);
    const RtpBytes frame{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
    constexpr std::int64_t t_ns = 0x0000'0000'4996'02D2;  // 1.23456789 s, 111111.1 ticks of 90 kHz
    const RtpBytes first{0x90, 96,                        // version 2, an extension; not the last, type 96
                         0x00, 0x00,                      // sequence number, low bits
                         0x00, 0x01, 0xB2, 0x07,          // time stamp: 111111
                         0xA1, 0xB2, 0xC3, 0xD4,          // SSRC
                         0xBE, 0xDE, 0x00, 0x04,          // RFC 8285: one-byte headers, 4 words
                         0x1B,                            // element 1 of 12 bytes
                         0x00, 0x00, 0x00, 0x00, 0x49, 0x96, 0x02, 0xD2,  // time, ns
                         0x01, 0x02, 0x03, 0x04,                          // number
                         0x00, 0x00, 0x00,                                // padding to whole words
                         0x00, 0x00,                                      // sequence number, high bits
                         0x00, 0x08, 0x00, 0x00, 0x80, 0x00,  // 8 bytes of row 0, from pixel 0; another row follows
                         0x00, 0x08, 0x00, 0x01, 0x00, 0x00,  // 8 bytes of row 1, from pixel 0
                         0x80, 1,    0x80, 2,    0x80, 3,    0x80, 4,  // Cb Y0 Cr Y1
                         0x80, 5,    0x80, 6,    0x80, 7,    0x80, 8};
    const RtpBytes second{0x90, 0x80 | 96,  // the last of its frame
                          0x00, 0x01,      0x00, 0x01, 0xB2, 0x07, 0xA1, 0xB2, 0xC3, 0xD4, 0xBE, 0xDE,
                          0x00, 0x04,      0x1B, 0x00, 0x00, 0x00, 0x00, 0x49, 0x96, 0x02, 0xD2, 0x01,
                          0x02, 0x03,      0x04, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x08, 0x00, 0x02,
                          0x00, 0x00,      0x80, 9,    0x80, 10,   0x80, 11,   0x80, 12};
    EXPECT_TRUE(std::ranges::equal(packets.next(frame, t_ns, 0x01020304, 0), first));
    EXPECT_TRUE(std::ranges::equal(packets.next(frame, t_ns, 0x01020304, 1), second));
}

/// RFC 4175, section 4.3: the groups of pixels of each format. Y = 0xABC0 and 0x1230, with 16 bits.
TEST(RtpVideo, GroupsOfPixelsAreThoseOfTheStandard) {
    const struct {
        std::string_view format;
        RtpBytes frame, group;
    } cases[] = {
        // Cb = 512, Y0 = 0xABC0 >> 6 = 687, Cr = 512, Y1 = 0x1230 >> 6 = 72:
        // 10'0000'0000 10'1010'1111 10'0000'0000 00'0100'1000
        {"Y10", {0xC0, 0xAB, 0x30, 0x12}, {0x80, 0x2A, 0xF8, 0x00, 0x48}},
        {"Y10P",
         {0xC0, 0xAB, 0x30, 0x12, 0xC0, 0xAB, 0x30, 0x12},
         {0x80, 0x2A, 0xF8, 0x00, 0x48, 0x80, 0x2A, 0xF8, 0x00, 0x48}},
        // Cb = 0x800, Y0 = 0xABC, Cr = 0x800, Y1 = 0x123
        {"Y12", {0xC0, 0xAB, 0x30, 0x12}, {0x80, 0x0A, 0xBC, 0x80, 0x01, 0x23}},
        {"Y14", {0xC0, 0xAB, 0x30, 0x12}, {0x80, 0x00, 0xAB, 0xC0, 0x80, 0x00, 0x12, 0x30}},
        {"Y16", {0xC1, 0xAB, 0x32, 0x12}, {0x80, 0x00, 0xAB, 0xC1, 0x80, 0x00, 0x12, 0x32}},
        {"GREY", {0xAB, 0x12}, {0x80, 0xAB, 0x80, 0x12}},
        {"YUYV", {0xAB, 0x40, 0x12, 0x50}, {0x40, 0xAB, 0x50, 0x12}},  // Cb Y0 Cr Y1
        {"RGB24", {1, 2, 3, 4, 5, 6}, {1, 2, 3, 4, 5, 6}},
    };
    for (const auto& c : cases) {
        const VideoFormat format = link_format(c.format, c.format == "Y10P" ? 4 : 2, 1);
        RtpVideoPackets packets = packets_of(format, 100);
        const auto packet = packets.next(c.frame, 0, 0, 0);
        EXPECT_TRUE(std::ranges::equal(packet.subspan(kBeforeRows + 6), c.group)) << c.format;
        EXPECT_EQ(get_be<std::uint16_t>(&packet[kBeforeRows]), c.group.size()) << c.format;
    }
}

TEST(RtpVideo, TimeIsThatOf90KilohertzAndWraps) {
    EXPECT_EQ(rtp_time(1'000'000'000), 90'000u);
    EXPECT_EQ(rtp_time(99'999), 8u);
    EXPECT_EQ(rtp_time(100'000), 9u);
    EXPECT_EQ(rtp_time(-100'000), 0xFFFFFFF7u);
    EXPECT_EQ(rtp_time(-99'999), 0xFFFFFFF7u) << "rounded down";
    EXPECT_EQ(rtp_time(0), 1u) << "0 is not sent";
    EXPECT_EQ(rtp_time(47'721'858'900'000), 5u) << "2^32 ticks are 47721.8588444 s";
    EXPECT_EQ(rtp_time(9'000'000'000'000'000'000), 3'527'712'768u) << "285 years, 8.1e14 ticks";
}

TEST(RtpVideo, EachPixelIsSentOnceAndNoPacketIsLarger) {
    for (const char* name : {"GREY", "Y10", "Y12", "Y16", "RGB24"})
        for (const std::size_t most : {64u, 100u, 333u, 1472u, 9000u, 65507u}) {
            const VideoFormat format = link_format(name, 200, 30);
            const RtpSampling sampling = *rtp_sampling(format);
            RtpVideoPackets packets = packets_of(format, most);
            const RtpPackets sent = frame_packets(packets, noise(format, 1), 1);
            std::set<std::pair<int, int>> groups;
            std::size_t bytes = 0;
            for (const RtpBytes& packet : sent) {
                EXPECT_LE(packet.size(), most);
                EXPECT_EQ((packet[1] & 0x80) != 0, &packet == &sent.back()) << "the last one has the marker";
                bytes += packet.size();
                bool more = true;
                for (std::size_t at = kBeforeRows; more; at += 6) {
                    const int length = get_be<std::uint16_t>(&packet[at]),
                              row = get_be<std::uint16_t>(&packet[at + 2]);
                    const int offset = get_be<std::uint16_t>(&packet[at + 4]) & 0x7FFF;
                    more = (packet[at + 4] & 0x80) != 0;
                    const int group_bytes = static_cast<int>(sampling.group_bytes);
                    ASSERT_EQ(length % group_bytes, 0);
                    for (int k = 0; k < length / group_bytes; ++k)
                        EXPECT_TRUE(
                            groups.insert({row, offset + k * static_cast<int>(sampling.group_pixels)}).second);
                }
            }
            EXPECT_EQ(groups.size(), 30u * 200u / sampling.group_pixels) << name << ' ' << most;
            EXPECT_EQ(groups.rbegin()->first, 29);
            EXPECT_EQ(bytes, packets.frame_packets_bytes()) << name << ' ' << most;
        }
}

TEST(RtpVideo, SequenceNumbersHave32Bits) {
    const VideoFormat format{2, 1, PixelFormat::grey, 100'000'000};
    RtpVideoPackets packets = packets_of(format, 64);
    for (std::uint32_t i = 0; i < 65537; ++i) {
        const auto packet = packets.next(RtpBytes{1, 2}, 0, i, 0);
        ASSERT_EQ(get_be<std::uint16_t>(&packet[2]), i & 0xFFFF);
        ASSERT_EQ(get_be<std::uint16_t>(&packet[32]), i >> 16);
    }
}

TEST(RtpVideo, FramesComeOutAsTheyWereSent) {
    for (const char* name : {"GREY", "Y10", "Y12", "Y14", "Y16", "Y10P", "Y12P", "YUYV", "RGB24"})
        for (const std::size_t most : {64u, 333u, 1472u, 65507u}) {
            const VideoFormat format = link_format(name, 200, 30);
            RtpVideoPackets packets = packets_of(format, most);
            RtpVideoAssembly assembly(format, *rtp_sampling(format));
            for (std::uint32_t n = 0; n < 3; ++n) {
                const RtpBytes frame = noise(format, n);
                RtpPackets sent = frame_packets(packets, frame, n);
                std::shuffle(sent.begin(), sent.end(), std::mt19937(n));
                const RtpVideoAssembly::Frame* whole = nullptr;
                for (const RtpBytes& packet : sent) {
                    ASSERT_EQ(whole, nullptr);
                    whole = assembly.take(packet);
                }
                ASSERT_NE(whole, nullptr) << name << ' ' << most;
                EXPECT_TRUE(whole->bytes == frame) << name << ' ' << most;
                EXPECT_EQ(whole->number, n);
                EXPECT_EQ(whole->t_ns, std::int64_t{n} * 100'000'000 + 75'000);
            }
            EXPECT_EQ(assembly.counters().whole, 3u);
            EXPECT_EQ(assembly.counters().incomplete + assembly.counters().refused, 0u);
        }
}

TEST(RtpVideo, LossesAreCountedAndNoPartOfAFrameComesOut) {
    const VideoFormat format{64, 10, PixelFormat::grey, 100'000'000};
    RtpVideoPackets packets = packets_of(format, 300);  // a row each
    RtpVideoAssembly assembly(format, *rtp_sampling(format));
    std::vector<std::uint32_t> came;
    RtpBytes late;
    for (std::uint32_t n = 0; n < 8; ++n) {
        RtpPackets sent = frame_packets(packets, noise(format, n), n);
        if (n == 1) sent.erase(sent.begin() + 4);                    // one is lost
        if (n == 3) late = sent.back(), sent.pop_back();             // and the last one
        if (n == 4) sent.insert(sent.begin() + 5, {late, sent[4]});  // too late, and one twice
        if (n == 5 || n == 6) sent.clear();                          // two whole frames
        for (const RtpBytes& packet : sent)
            if (const auto* frame = assembly.take(packet)) {
                EXPECT_TRUE(frame->bytes == noise(format, n));
                came.push_back(*frame->number);
            }
    }
    EXPECT_EQ(came, (std::vector<std::uint32_t>{0, 2, 4, 7}));
    EXPECT_EQ(assembly.counters().incomplete, 2u);
    EXPECT_EQ(assembly.counters().missing, 2u);
    EXPECT_EQ(assembly.counters().refused, 2u);
    EXPECT_EQ(assembly.counters().unfit, 0u);
}

TEST(RtpVideo, ASenderThatBeginsAgainIsFollowed) {
    const VideoFormat format{64, 10, PixelFormat::grey, 100'000'000};
    RtpVideoAssembly assembly(format, *rtp_sampling(format));
    std::vector<std::uint32_t> came;
    for (const std::uint32_t n : {500u, 501u, 0u, 1u}) {
        RtpVideoPackets packets = packets_of(format, 300);
        for (const RtpBytes& packet : frame_packets(packets, noise(format, n), n))
            if (const auto* frame = assembly.take(packet)) came.push_back(*frame->number);
    }
    EXPECT_EQ(came, (std::vector<std::uint32_t>{500, 501, 0, 1}));
}

/// Without the extension, with CSRCs and padding, and with other elements in the extension.
TEST(RtpVideo, ReadsPacketsOfOtherSenders) {
    const VideoFormat format{4, 1, PixelFormat::grey, 100'000'000};
    const RtpBytes rows{0, 0, 0, 8, 0, 0, 0, 0, 0x33, 1, 0x44, 2, 0x55, 3, 0x66, 4};
    const auto packet = [&](std::uint8_t first, const RtpBytes& between, std::uint8_t ticks,
                            const RtpBytes& after) {
        RtpBytes p{first, 0xE0, 0, 7, 0, 0, 0, ticks, 1, 2, 3, 4};
        p.insert(p.end(), between.begin(), between.end());
        p.insert(p.end(), rows.begin(), rows.end());
        p.insert(p.end(), after.begin(), after.end());
        return p;
    };
    RtpVideoAssembly assembly(format, *rtp_sampling(format));
    const RtpBytes wanted{1, 2, 3, 4};
    const auto expect = [&](const RtpBytes& p, const std::optional<std::uint32_t>& number) {
        const auto* frame = assembly.take(p);
        ASSERT_NE(frame, nullptr);
        EXPECT_EQ(frame->bytes, wanted);
        EXPECT_EQ(frame->number, number);
    };
    expect(packet(0x80, {}, 1, {}), std::nullopt);
    expect(packet(0x82, RtpBytes(8, 9), 2, {}), std::nullopt);
    expect(packet(0xA0, {}, 3, {0, 0, 3}), std::nullopt);
    expect(packet(0x90, {0x10, 0x00, 0, 1, 1, 2, 3, 4}, 4, {}), std::nullopt);  // two-byte headers
    expect(
        packet(0x90, {0xBE, 0xDE, 0, 5, 0x21, 8, 8, 0, 0x1B, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 6, 0, 0, 0}, 5, {}),
        6u);
    EXPECT_EQ(assembly.counters().whole, 5u);
}

TEST(RtpVideo, DamagedPacketsAreRefused) {
    const VideoFormat format{4, 2, PixelFormat::grey, 100'000'000};
    RtpVideoPackets packets = packets_of(format, 64);
    const RtpBytes good = frame_packets(packets, {1, 2, 3, 4, 5, 6, 7, 8}, 1).front();
    for (std::size_t size = 0; size < good.size(); ++size) {
        RtpVideoAssembly assembly(format, *rtp_sampling(format));
        EXPECT_EQ(assembly.take(std::span(good).first(size)), nullptr) << size;
        EXPECT_EQ(assembly.counters().refused + assembly.counters().unfit, 1u) << size;
    }
    const struct {
        std::size_t at;
        std::uint8_t value;
    } faults[] = {{0, 0x50},  {0, 0xD0},  {1, 97},      // version, payload type
                  {34, 0x01}, {35, 0},    {35, 7},      // length: too large, none, not whole groups
                  {36, 0x80}, {37, 2},                  // second field, row
                  {39, 1},    {39, 2},    {38, 0x00},   // offset: within a group, past the end; no second row
                  {43, 0},    {15, 0xFF}, {15, 0x05}};  // a row twice, ends before the last; extension's length
    for (const auto& fault : faults) {
        RtpBytes bad = good;
        bad[fault.at] = fault.value;
        RtpVideoAssembly assembly(format, *rtp_sampling(format));
        EXPECT_EQ(assembly.take(bad), nullptr) << fault.at << ' ' << int{fault.value};
        EXPECT_EQ(assembly.counters().refused + assembly.counters().unfit, 1u)
            << fault.at << ' ' << int{fault.value};
    }
    RtpVideoAssembly assembly(format, *rtp_sampling(format));
    EXPECT_NE(assembly.take(good), nullptr);
}

TEST(RtpVideo, FramesOfAnotherSizeAreSeenByTheirMarker) {
    for (const auto& [width, height] : {std::pair{32, 10}, {64, 8}, {128, 10}, {64, 12}}) {
        const VideoFormat format{64, 10, PixelFormat::grey, 100'000'000};
        RtpVideoPackets packets = packets_of({width, height, PixelFormat::grey, 100'000'000}, 1472);
        RtpVideoAssembly assembly(format, *rtp_sampling(format));
        for (const RtpBytes& packet : frame_packets(packets, RtpBytes(static_cast<std::size_t>(width * height)), 1))
            EXPECT_EQ(assembly.take(packet), nullptr);
        EXPECT_GT(assembly.counters().unfit, 0u) << width << ' ' << height;
    }
}

TEST(RtpVideo, FormatsThatTheStandardLacksAreNamed) {
    const auto why = [](const VideoFormat& format) {
        const auto sampling = rtp_sampling(format);
        return sampling ? "" : sampling.error().what;
    };
    EXPECT_EQ(why(link_format("RGGB12P", 64, 48)),
              "RFC 4175 has no mosaics such as RGGB12P; it carries GREY, Y10, Y12, Y14, Y16, YUYV and RGB24");
    EXPECT_EQ(why(link_format("BGGR8", 64, 48)).substr(0, 37), "RFC 4175 has no mosaics such as BGGR8");
    EXPECT_EQ(why({63, 48, PixelFormat::grey, 1}),
              "RFC 4175 carries GREY in pairs of pixels, expected an even width, not 63");
    EXPECT_EQ(why({63, 48, PixelFormat::rgb24, 1}), "");
    EXPECT_EQ(why({64, 32769, PixelFormat::grey, 1}),
              "RFC 4175 carries at most 32768 x 32768 pixels, not 64 x 32769");
    VideoFormat with_line = link_format("Y10", 200, 48);
    with_line.link.first_bytes_kept = 160;
    EXPECT_NE(why(with_line).find("expected no embedded_line"), std::string::npos) << why(with_line);
    for (const char* whole_bytes : {"GREY", "Y14", "Y16", "RGB24"}) {
        with_line = link_format(whole_bytes, 200, 48);
        with_line.link.first_bytes_kept = 160;
        EXPECT_EQ(why(with_line), "") << whole_bytes;
    }
}

TEST(RtpVideo, SdpTellsReceiversWhatComes) {
    const VideoFormat format = link_format("Y10", 640, 480);
    RtpSession session{.sender = "192.168.1.5", .receiver = "192.168.1.70", .port = 5004};
    EXPECT_EQ(rtp_video_sdp(format, *rtp_sampling(format), session),
              "v=0\r\no=- 0 0 IN IP4 192.168.1.5\r\ns=narpa camera\r\nc=IN IP4 192.168.1.70\r\nt=0 0\r\n"
              "m=video 5004 RTP/AVP 96\r\na=rtpmap:96 raw/90000\r\n"
              "a=fmtp:96 sampling=YCbCr-4:2:2; width=640; height=480; depth=10; colorimetry=BT601-5; "
              "exactframerate=10; RANGE=FULL\r\na=extmap:1 urn:x-narpa:frame\r\na=recvonly\r\n");
    const auto has = [&](const VideoFormat& f, const std::string& text) {
        return rtp_video_sdp(f, *rtp_sampling(f), session).find(text) != std::string::npos;
    };
    session.receiver = "239.1.2.3", session.multicast_ttl = 4;
    EXPECT_TRUE(has(format, "c=IN IP4 239.1.2.3/4\r\n"));
    session = {.sender = "fe80::1", .receiver = "ff15::1", .ipv6 = true, .multicast_ttl = 4, .port = 5004};
    EXPECT_TRUE(has(format, "c=IN IP6 ff15::1\r\n"));
    EXPECT_TRUE(has(format, "o=- 0 0 IN IP6 fe80::1\r\n"));
    EXPECT_TRUE(has({640, 480, PixelFormat::rgb24, 33'366'700}, "sampling=RGB; width=640; height=480; depth=8; "));
    EXPECT_TRUE(has({640, 480, PixelFormat::rgb24, 33'366'700}, "exactframerate=10000000/333667; RANGE=FULL"));
    EXPECT_TRUE(has({640, 480, PixelFormat::yuyv, 100'000'000}, "RANGE=NARROW"));
}

}  // namespace
}  // namespace narpa
