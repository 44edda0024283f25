// The USB camera against a host that speaks USB/IP and UVC, with no kernel between them.
#include <gtest/gtest.h>

#include <thread>

#include "base/time.h"
#include "drivers/video/video_sink.h"
#include "protocols/little_endian.h"
#include "protocols/usb/uvc.h"
#include "tests/drivers/usbip_client.h"

namespace narpa {
namespace {

using UvcBytes = std::vector<std::uint8_t>;

class UvcSink : public testing::Test {
protected:
    void open(PixelFormat pixel = PixelFormat::grey, WhenFull full = WhenFull::wait) {
        format_.pixel = pixel;
        auto sink =
            open_video_sink("uvc:0", format_, full, VideoControls{50'000, 30'000'000, 5'000'000, 2400, 0, false});
        ASSERT_TRUE(sink) << sink.error().text();
        sink_ = *std::move(sink);
        const std::string text = sink_->description();
        port_ = static_cast<std::uint16_t>(std::stoi(text.substr(text.find("127.0.0.1:") + 10)));
    }
    [[nodiscard]] UvcBytes picture(int number) const {
        UvcBytes f(frame_bytes(format_));
        for (std::size_t i = 0; i < f.size(); ++i)
            f[i] = static_cast<std::uint8_t>(number * 31 + static_cast<int>(i % 251));
        return f;
    }
    static void start_stream(UsbIpClient& host, const VideoFormat& format) {
        const auto probe = encode_uvc_probe(uvc_probe(format));
        EXPECT_EQ(host.ask({0xa1, UvcRequest::kGetCurrent, 0x0100, 1, 26}).data,
                  UvcBytes(probe.begin(), probe.end()));
        EXPECT_EQ(host.tell({0x21, UvcRequest::kSetCurrent, 0x0200, 1, 26}, probe).reply.status, 0);
    }
    struct Taken {
        UvcBytes bytes;
        bool frame_id = false;
        std::uint32_t presentation = 0;
    };
    /// A whole frame.
    static Taken take(UsbIpClient& host) {
        Taken t;
        for (;;) {
            host.begin(UvcIds::kStream, true, kUvcPayloadBytes);
            const auto done = host.next(true);
            const auto header = decode_uvc_header(done.data);
            EXPECT_TRUE(header) << done.reply.status;
            if (!header) return t;
            t.bytes.insert(t.bytes.end(), done.data.begin() + kUvcHeaderBytes, done.data.end());
            t.frame_id = header->frame_id, t.presentation = header->presentation;
            if (header->end_of_frame) return t;
        }
    }

    VideoFormat format_{200, 120, PixelFormat::grey, 100'000'000};
    std::unique_ptr<VideoSink> sink_;
    std::uint16_t port_ = 0;
};

TEST_F(UvcSink, FramesAreWholeInOrderAndTheirIdentityToggles) {
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv}) {
        open(pixel);
        UsbIpClient host(port_);
        ASSERT_EQ(host.import(), 0u);
        ASSERT_TRUE(sink_->send(picture(99)));
        sink_->flush();
        EXPECT_EQ(sink_->counters().no_reader, 1u) << "no stream yet";
        start_stream(host, format_);
        std::thread camera([&] {
            for (int n = 0; n < 12; ++n) EXPECT_TRUE(sink_->send(picture(n)));
        });
        bool id = true;
        for (int n = 0; n < 12; ++n) {
            const Taken t = take(host);
            ASSERT_EQ(t.bytes, picture(n)) << n;
            EXPECT_NE(t.frame_id, id);
            id = t.frame_id;
        }
        camera.join();
        sink_->flush();
        EXPECT_EQ(sink_->counters().written, 12u);
        EXPECT_EQ(sink_->counters().failed + sink_->counters().ring_full, 0u);
    }
}

TEST_F(UvcSink, AStreamEndsAndBeginsAnew) {
    open();
    for (std::uint64_t turn = 1; turn <= 3; ++turn) {
        UsbIpClient host(port_);
        while (host.import() != 0) host = UsbIpClient(port_);  // until the server has seen the last one leave
        start_stream(host, format_);
        ASSERT_TRUE(sink_->send(picture(1)));
        EXPECT_EQ(take(host).bytes, picture(1));
        EXPECT_EQ(host.tell({0x02, 1, 0, 0x81, 0}, {}).reply.status, 0);  // as Linux ends a bulk stream
        ASSERT_TRUE(sink_->send(picture(2)));
        sink_->flush();
        EXPECT_EQ(sink_->counters().no_reader, turn);
        start_stream(host, format_);
        ASSERT_TRUE(sink_->send(picture(3)));
        EXPECT_EQ(take(host).bytes, picture(3)) << "nothing of the frame that was not seen";
        sink_->flush();
        EXPECT_EQ(sink_->counters().reconnects, 2 * turn);
    }
}

TEST_F(UvcSink, ACablePulledInAFrameCostsThatFrameAlone) {
    open();
    {
        UsbIpClient host(port_);
        ASSERT_EQ(host.import(), 0u);
        start_stream(host, format_);
        ASSERT_TRUE(sink_->send(picture(1)));
        host.begin(UvcIds::kStream, true, kUvcPayloadBytes);
        EXPECT_EQ(host.next(true).data.size(), kUvcPayloadBytes) << "the first part";
    }
    sink_->flush();
    EXPECT_EQ(sink_->counters().failed, 1u);
    EXPECT_EQ(sink_->counters().written, 0u);
}

TEST_F(UvcSink, ControlsAreCheckedAndHandedOn) {
    open();
    UsbIpClient host(port_);
    ASSERT_EQ(host.import(), 0u);
    constexpr std::uint16_t kCamera = UvcIds::kCamera << 8, kProcessing = UvcIds::kProcessing << 8;
    const auto get = [&](std::uint8_t request, std::uint16_t selector, std::uint16_t unit, std::uint16_t bytes) {
        auto data = host.ask({0xa1, request, static_cast<std::uint16_t>(selector << 8), unit, bytes}).data;
        data.resize(4);
        return get_le<std::uint32_t>(data.data());
    };
    const auto set = [&](std::uint16_t selector, std::uint16_t unit, const UvcBytes& data) {
        const auto n = static_cast<std::uint16_t>(data.size());
        return host.tell({0x21, UvcRequest::kSetCurrent, static_cast<std::uint16_t>(selector << 8), unit, n}, data)
            .reply.status;
    };
    EXPECT_EQ(get(UvcRequest::kGetMinimum, UvcControl::kExposureTime, kCamera, 4), 1u) << "0.1 ms";
    EXPECT_EQ(get(UvcRequest::kGetMaximum, UvcControl::kExposureTime, kCamera, 4), 300u);
    EXPECT_EQ(get(UvcRequest::kGetDefault, UvcControl::kExposureTime, kCamera, 4), 50u);
    EXPECT_EQ(get(UvcRequest::kGetMaximum, UvcControl::kGain, kProcessing, 2), 2400u);
    EXPECT_EQ(get(UvcRequest::kGetStep, UvcControl::kExposureMode, kCamera, 1), 3u) << "manual and automatic";
    EXPECT_EQ(set(UvcControl::kExposureTime, kCamera, {123, 0, 0, 0}), 0);
    EXPECT_EQ(set(UvcControl::kGain, kProcessing, {0x58, 2}), 0);
    EXPECT_EQ(set(UvcControl::kExposureMode, kCamera, {2}), 0);
    EXPECT_EQ(get(UvcRequest::kGetCurrent, UvcControl::kExposureTime, kCamera, 4), 123u);
    VideoRequest r;
    ASSERT_TRUE(sink_->next_request(r));
    EXPECT_EQ(r.exposure_ns, 12'300'000);
    ASSERT_TRUE(sink_->next_request(r));
    EXPECT_EQ(r.gain_cdb, 600);
    ASSERT_TRUE(sink_->next_request(r));
    EXPECT_EQ(r.auto_exposure, true);
    EXPECT_FALSE(sink_->next_request(r));
    EXPECT_EQ(set(UvcControl::kExposureTime, kCamera, {0x2d, 1, 0, 0}), -32) << "301: above the most";
    EXPECT_EQ(get(UvcRequest::kGetCurrent, UvcControl::kErrorCode, 0, 1), 4u) << "out of range";
    EXPECT_EQ(set(UvcControl::kExposureTime, kCamera, {1, 0}), -32) << "too short";
    EXPECT_EQ(set(9, kCamera, {1, 0}), -32) << "no such control";
    EXPECT_FALSE(sink_->next_request(r));
}

TEST(UvcSinkSpec, WhatItCannotCarryIsSaid) {
    const VideoFormat grey{64, 48, PixelFormat::grey, 100'000'000};
    for (const char* bad : {"uvc:", "uvc:x", "uvc:nowhere:1", "uvc:70000"}) {
        const auto sink = open_video_sink(bad, grey, WhenFull::drop);
        ASSERT_FALSE(sink) << bad;
        EXPECT_NE(sink.error().what.find("expected uvc:"), std::string::npos) << sink.error().what;
    }
    const auto sink = open_video_sink("uvc:0", {64, 48, PixelFormat::rgb24, 100'000'000}, WhenFull::drop);
    ASSERT_FALSE(sink);
    EXPECT_NE(sink.error().what.find("not RGB24"), std::string::npos) << sink.error().what;
}

}  // namespace
}  // namespace narpa
