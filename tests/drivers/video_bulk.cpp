// The frame bridge in software against a host that speaks USB/IP, and what a bulk sink is told. The sink itself
// needs a kernel: usb_host.cpp.
#include <gtest/gtest.h>

#include <numeric>

#include "drivers/usb/bridge_device.h"
#include "drivers/video/bulk_bridges.h"
#include "drivers/video/video_sink.h"
#include "drivers/video/video_source.h"
#include "protocols/crc32.h"
#include "tests/drivers/usbip_client.h"

namespace narpa {
namespace {

using FrameBytes = std::vector<std::uint8_t>;

class BulkBridge : public testing::Test {
protected:
    void SetUp() override {
        auto source = open_video_source("bridge:0", format_);
        ASSERT_TRUE(source) << source.error().text();
        source_ = *std::move(source);
        const std::string text = source_->description();
        host_.emplace(static_cast<std::uint16_t>(std::stoi(text.substr(text.find("127.0.0.1:") + 10))));
        ASSERT_EQ(host_->import(), 0u);
    }
    /// Header and pixels, as a bulk sink sends them.
    [[nodiscard]] FrameBytes message(std::uint32_t number, const VideoFormat& format) const {
        FrameBytes pixels(frame_bytes(format));
        std::iota(pixels.begin(), pixels.end(), static_cast<std::uint8_t>(number * 17));
        const auto header = encode_bulk_header({5, number, format.pixel, static_cast<std::uint32_t>(format.width),
                                                static_cast<std::uint32_t>(format.height), crc32(pixels)});
        FrameBytes all(header.begin(), header.end());
        all.insert(all.end(), pixels.begin(), pixels.end());
        return all;
    }
    void begin(std::span<const std::uint8_t> bytes) {
        host_->begin(BridgeDevice::kOut, false, static_cast<std::uint32_t>(bytes.size()), {}, bytes);
    }
    /// One transfer, whole.
    void put(std::span<const std::uint8_t> bytes) {
        begin(bytes);
        const auto done = host_->next(false).reply;
        EXPECT_EQ(done.status, 0);
        EXPECT_EQ(done.length, bytes.size());
    }
    void expect_frame(const FrameBytes& of) {
        FrameBytes pixels(frame_bytes(format_));
        ASSERT_TRUE(source_->receive(pixels, 10'000'000'000));
        EXPECT_TRUE(std::ranges::equal(pixels, std::span(of).subspan(kBulkHeaderBytes)));
    }
    void expect_nothing_more(std::uint64_t received, std::uint64_t truncated, std::uint64_t lost) {
        FrameBytes pixels(frame_bytes(format_));
        EXPECT_FALSE(source_->receive(pixels, 0));
        EXPECT_EQ(source_->counters().received, received);
        EXPECT_EQ(source_->counters().truncated, truncated);
        EXPECT_EQ(source_->counters().lost, lost);
    }

    VideoFormat format_{464, 3, PixelFormat::grey, 100'000'000};  // with the header 1440 bytes
    std::unique_ptr<VideoSource> source_;
    std::optional<UsbIpClient> host_;
};

TEST_F(BulkBridge, AFrameIsWhatComesUpToAShortPacket) {
    const FrameBytes a = message(1, format_), b = message(2, format_);
    put(a);
    expect_frame(a);
    put(std::span(b).first(512));
    put(std::span(b).subspan(512, 512));
    put(std::span(b).subspan(1024));
    expect_frame(b);
    expect_nothing_more(2, 0, 0);
}

TEST_F(BulkBridge, AFrameOfWholePacketsEndsWithAnEmptyOne) {
    format_ = {464, 1, PixelFormat::grey, 100'000'000};  // with the header 512 bytes
    SetUp();
    const FrameBytes a = message(1, format_);
    ASSERT_EQ(a.size(), BridgeDevice::kPacketBytes);
    put(a);
    expect_nothing_more(0, 0, 0);
    put({});
    expect_frame(a);
    put({});  // nothing stands before it: no frame
    expect_nothing_more(1, 0, 0);
}

TEST_F(BulkBridge, WhatIsNoFrameIsCountedAndTheNextOneComes) {
    FrameBytes good = message(1, format_);
    put(good);
    expect_frame(good);
    FrameBytes wrong_pixel = message(2, format_);
    wrong_pixel.back() ^= 1;
    FrameBytes wrong_header = message(3, format_);
    wrong_header[9] ^= 1;
    const VideoFormat wider{512, 3, PixelFormat::grey, 1}, other{232, 3, PixelFormat::y16, 1};
    FrameBytes longer = message(6, format_);
    longer.resize(longer.size() + 5000);
    std::uint64_t truncated = 0;
    for (const FrameBytes& bad : {wrong_pixel, wrong_header, message(4, wider), message(5, other), longer,
                                  FrameBytes(100, 7), FrameBytes(good.begin(), good.end() - 1)}) {
        put(bad);
        put({});
        expect_nothing_more(1, ++truncated, 0);
    }
    good = message(9, format_);
    put(good);
    expect_frame(good);
    expect_nothing_more(2, truncated, 7);  // 2 to 8
}

TEST_F(BulkBridge, AFrameThatIsCutShortIsEndedByTheHost) {
    const FrameBytes a = message(1, format_), b = message(2, format_);
    put(std::span(a).first(512));
    put({});
    put(b);
    expect_frame(b);
    put(std::span(a).first(512));
    EXPECT_EQ(host_->tell({0x02, UsbRequest::kClearFeature, 0, BridgeDevice::kOut, 0}, {}).reply.status, 0);
    const FrameBytes c = message(3, format_);
    put(c);
    expect_frame(c);
    expect_nothing_more(2, 2, 0);
}

TEST_F(BulkBridge, ASlowReaderHoldsTheHost) {
    constexpr std::uint32_t kMore = 3;
    for (std::uint32_t k = 0; k < BridgeDevice::kFrames; ++k) put(message(k, format_));
    for (std::uint32_t k = 0; k < kMore; ++k) begin(message(BridgeDevice::kFrames + k, format_));
    const auto ask = host_->begin(0, true, 18, {0x80, 6, 0x0100, 0, 18});
    EXPECT_EQ(host_->next(true).reply.sequence, ask) << "the others wait";
    for (std::uint32_t k = 0; k < BridgeDevice::kFrames + kMore; ++k) expect_frame(message(k, format_));
    for (std::uint32_t k = 0; k < kMore; ++k) EXPECT_EQ(host_->next(false).reply.status, 0);
    expect_nothing_more(BridgeDevice::kFrames + kMore, 0, 0);
}

TEST(BulkSpec, TextsAreReadOrRefused) {
    for (const auto& [text, device] :
         {std::pair{"", ""}, {"1-4.2", "1-4.2"}, {"04b4:00f1/", ""}, {"04B4:00f1/A7", "A7"}}) {
        const auto spec = parse_bulk(text);
        ASSERT_TRUE(spec) << text;
        EXPECT_EQ(spec->device, device);
        EXPECT_EQ(spec->id.has_value(), std::string_view(text).find(':') != std::string_view::npos);
        if (!spec->id) continue;
        EXPECT_EQ(spec->id->vendor, 0x04b4);
        EXPECT_EQ(spec->id->product, 0x00f1);
    }
    for (const char* bad :
         {"04b4:00f1", "4b4:00f1/", "04b4:00f1/a/b", "04b4-00f1/", "04b4:00g1/", "a b", "-4b4:00f1/"}) {
        const auto sink =
            open_video_sink(std::string("bulk:") + bad, {64, 48, PixelFormat::grey, 1}, WhenFull::drop);
        ASSERT_FALSE(sink) << bad;
        EXPECT_EQ(sink.error().kind, ErrorKind::bad_input);
        EXPECT_NE(sink.error().what.find("expected bulk:[VENDOR:PRODUCT/]"), std::string::npos)
            << sink.error().what;
    }
    const auto none = open_video_sink("bulk:no-such-bridge", {64, 48, PixelFormat::grey, 1}, WhenFull::drop);
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().kind, ErrorKind::missing);
    const auto source = open_video_source("bridge:x", {64, 48, PixelFormat::grey, 1});
    ASSERT_FALSE(source);
    EXPECT_NE(source.error().what.find("expected bridge:[ADDRESS:]PORT"), std::string::npos) << source.error().what;
}

}  // namespace
}  // namespace narpa
