// narpa's drivers as a USB host, through the kernel's vhci_hcd and libusb, against devices in software that behave
// badly or are pulled out. NARPA_TEST_VHCI says that this machine has vhci_hcd and vcan0, and that we are root.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <functional>
#include <thread>

#include "drivers/usb/bridge_device.h"
#include "drivers/usb/faulty_device.h"
#include "drivers/usb/gs_usb_device.h"
#include "drivers/usb/usbip_server.h"
#include "drivers/usb/vhci_port.h"
#include "drivers/video/video_sink.h"
#include "tests/drivers/can_support.h"

namespace narpa {
namespace {

class UsbHost : public testing::Test {
protected:
    void SetUp() override {
        if (std::getenv("NARPA_TEST_VHCI") == nullptr) GTEST_SKIP() << "NARPA_TEST_VHCI is not set";
    }
    void serve(UsbDevice& device) {
        auto server = UsbIpServer::start("127.0.0.1", 0, device);
        ASSERT_TRUE(server) << server.error().text();
        server_ = *std::move(server);
    }
    void plug_in() {
        const std::int64_t until_ns = monotonic_ns() + 10 * kSecond_ns;
        auto port = VhciPort::attach(server_->port());
        while (!port && monotonic_ns() < until_ns)
            port = VhciPort::attach(server_->port());  // the last host leaves
        ASSERT_TRUE(port) << port.error().text();
        port_ = *std::move(port);
    }
    /// `open` again until the kernel has seen the device.
    template <class T>
    Result<T> opened(const std::function<Result<T>()>& open) {
        const std::int64_t until_ns = monotonic_ns() + 60 * kSecond_ns;
        for (;;) {
            auto device = open();
            if (device || device.error().what.find("is plugged in") == std::string::npos ||
                monotonic_ns() > until_ns)
                return device;
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
    }

    std::unique_ptr<UsbIpServer> server_;
    std::unique_ptr<VhciPort> port_;
};

// --- A USB-CAN adapter -----------------------------------------------

class UsbHostCan : public UsbHost {
protected:
    /// An adapter with vcan0 behind it, which is also the peer's.
    void plug_in_adapter(UsbFault fault, std::uint64_t after) {
        behind_ = open_or_fail("vcan0", CanRole::hub);
        peer_ = open_or_fail("vcan0", CanRole::client);
        ASSERT_TRUE(behind_ && peer_);
        faulty_ = std::make_unique<FaultyDevice>(adapter_, fault, after);
        serve(*faulty_);
        can_ = std::thread([this] {
            while (!ending_)
                if (adapter_.turn(*behind_, 10'000'000)) server_->wake();
        });
        plug_in();
    }
    Result<std::unique_ptr<CanBus>> open_usb() {
        return opened<std::unique_ptr<CanBus>>([] { return open_can_bus("usb:", CanRole::hub); });
    }
    void open(UsbFault fault, std::uint64_t after) {
        plug_in_adapter(fault, after);
        auto usb = open_usb();
        ASSERT_TRUE(usb) << usb.error().text();
        usb_ = *std::move(usb);
    }
    void TearDown() override {
        usb_.reset();
        port_.reset();
        ending_ = true;
        if (can_.joinable()) can_.join();
    }
    void expect_it_works() {
        ReceivedFrame out;
        EXPECT_TRUE(turn_until(*usb_, [&] {
            (void)peer_->send(can_frame(0x156, {1}));
            return usb_->receive(out) && out.frame.id == 0x156;
        }));
    }

    GsUsbDevice adapter_{"NARPA0001", true};
    std::unique_ptr<FaultyDevice> faulty_;
    std::unique_ptr<CanBus> behind_, peer_, usb_;
    std::atomic<bool> ending_{false};
    std::thread can_;
};

TEST_F(UsbHostCan, GoesOnAfterBusOff) {
    adapter_.bus_off_after(20);
    open(UsbFault::none, 0);
    ReceivedFrame out;
    EXPECT_TRUE(turn_until(*usb_, [&] {
        (void)usb_->send(can_frame(0x3, {3}));
        return usb_->counters().bus_off == 1;
    }));
    EXPECT_GE(usb_->counters().error_frames, 1u);
    EXPECT_TRUE(turn_until(*usb_, [&] {  // it restarts the channel by itself
        (void)usb_->send(can_frame(0x4, {4}));
        while (peer_->receive(out))
            if (out.frame.id == 0x4) return true;
        return false;
    }));
    EXPECT_EQ(usb_->counters().interface_down, 0u);
}

class UsbHostCanFaults : public UsbHostCan, public testing::WithParamInterface<UsbFault> {};

TEST_P(UsbHostCanFaults, EachBadTransferIsCountedAndTheOthersAreWhole) {
    open(GetParam(), 20);
    const CanFrame frame = can_frame(0x155, {1, 2, 3});
    std::uint64_t whole = 0;
    ReceivedFrame out;
    EXPECT_TRUE(turn_until(*usb_, [&] {
        (void)peer_->send(frame);
        for (; usb_->receive(out); ++whole) EXPECT_TRUE(same(out.frame, frame));
        return usb_->counters().malformed >= 20;
    })) << "each transfer that went wrong is counted";
    EXPECT_GE(whole, 150u) << "nine of ten transfers are as they should be";
    expect_it_works();
    EXPECT_EQ(usb_->counters().interface_down, 0u);
}

INSTANTIATE_TEST_SUITE_P(Faults, UsbHostCanFaults,
                         testing::Values(UsbFault::stall, UsbFault::shorten, UsbFault::babble));

TEST_F(UsbHostCan, AHungAdapterCostsDropsAndNoTime) {
    open(UsbFault::hang, 20);
    EXPECT_TRUE(turn_until(*usb_, [&] {
        for (int i = 0; i < 100 && usb_->send(can_frame(0x155, {1})); ++i) {
        }
        return usb_->counters().send_drops > 0;
    })) << "frames that it never takes are dropped and counted";
    usb_.reset();  // the driver does not wait for it
}

TEST_F(UsbHostCan, AFrameWithoutAnEchoCountsAsDroppedAndItsPlaceIsFree) {
    adapter_.lose_echoes_after(20);
    open(UsbFault::none, 0);
    // Of the 40 frames behind the first 20, half have no echo: twice as many as there are places.
    constexpr std::uint64_t kFrames = 60, kLost = 20;
    ReceivedFrame out;
    std::uint64_t sent = 0, came = 0;
    EXPECT_TRUE(turn_until(*usb_,
                           [&] {
                               if (sent < kFrames &&
                                   usb_->send(can_frame(0x157, {static_cast<std::uint8_t>(sent)})))
                                   ++sent;
                               for (; peer_->receive(out); ++came) EXPECT_EQ(out.frame.data[0], came);
                               return came == kFrames && usb_->counters().send_drops >= kLost;
                           }))
        << came << " came, " << usb_->counters().send_drops << " drops";
    EXPECT_EQ(usb_->counters().send_drops, kLost);
    EXPECT_EQ(usb_->counters().sent, kFrames - kLost);
    EXPECT_EQ(usb_->counters().malformed + usb_->counters().interface_down, 0u);
    expect_it_works();
}

TEST_F(UsbHostCan, AnswersThatAreCutShortAreNamedAtTheStart) {
    plug_in_adapter(UsbFault::answers, 1);
    const auto usb = open_usb();
    ASSERT_FALSE(usb);
    EXPECT_NE(usb.error().what.find("NARPA0001: does not speak gs_usb: its"), std::string::npos)
        << usb.error().what;
}

TEST_F(UsbHostCan, WrongDescriptorsAreNamedOrHarmless) {
    for (std::uint64_t kind = 1; kind <= kWrongConfigurations; ++kind) {
        FaultyDevice wrong(adapter_, UsbFault::descriptors, kind);
        serve(wrong);
        plug_in();
        const auto usb = open_usb();
        const std::string what = usb ? "works" : usb.error().what;
        std::printf("wrong configuration %d: %s\n", static_cast<int>(kind), what.c_str());
        EXPECT_TRUE(usb || what.find("NARPA0001: has no ") != std::string::npos) << kind << ": " << what;
        port_.reset();
        server_.reset();
    }
}

// --- A frame bridge --------------------------------------------------

constexpr VideoFormat kFiveTransfers{640, 480, PixelFormat::grey, 100'000'000};
constexpr VideoFormat kWholePackets{464, 33, PixelFormat::grey, 100'000'000};  // with the header 30 of 512 bytes
static_assert((kBulkHeaderBytes + frame_bytes(kWholePackets)) % BridgeDevice::kPacketBytes == 0);

class UsbHostBulk : public UsbHost {
protected:
    void open(const VideoFormat& format, UsbFault fault = UsbFault::none, std::uint64_t after = 0) {
        format_ = format;
        bridge_ = std::make_unique<BridgeDevice>(format, "NARPA-BRIDGE");
        faulty_ = std::make_unique<FaultyDevice>(*bridge_, fault, after);
        serve(*faulty_);
        plug_in();
        auto sink =
            opened<std::unique_ptr<VideoSink>>([&] { return open_video_sink("bulk:", format, WhenFull::wait); });
        ASSERT_TRUE(sink) << sink.error().text();
        sink_ = *std::move(sink);
        reader_ = std::thread([this] { read(); });
    }
    void TearDown() override { close(); }
    void close() {
        sink_.reset();
        ending_ = true;
        if (reader_.joinable()) reader_.join();
        port_.reset();
        server_.reset();
        ending_ = false;
    }
    void send(std::uint32_t number) { EXPECT_TRUE(sink_->send(picture(number), {time_of(number), number})); }
    [[nodiscard]] std::vector<std::uint8_t> picture(std::uint32_t number) const {
        std::vector<std::uint8_t> pixels(frame_bytes(format_));
        for (std::size_t i = 0; i < pixels.size(); ++i)
            pixels[i] = static_cast<std::uint8_t>(i * 7 + (i >> 9) * 13 + number * 31);
        return pixels;
    }
    /// Until each frame has been written or has failed; a flush gives a slow machine a second alone.
    VideoCounters settled(std::uint64_t sent) {
        VideoCounters c;
        for (const std::int64_t until_ns = monotonic_ns() + 60 * kSecond_ns; monotonic_ns() < until_ns;) {
            c = sink_->counters();
            if (c.written + c.failed == sent) break;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        return c;
    }
    static std::int64_t time_of(std::uint32_t number) { return 1'000'000'007 * std::int64_t{number} - 5; }
    /// All that was sent is in one of the counts, and each frame that was written came, byte for byte.
    void expect_all_accounted(std::uint64_t sent) {
        const VideoCounters c = settled(sent);
        EXPECT_EQ(c.written + c.failed, sent);
        EXPECT_EQ(c.ring_full + c.no_reader, 0u);
        for (const std::int64_t until_ns = monotonic_ns() + 60 * kSecond_ns;
             came_ < c.written && monotonic_ns() < until_ns;)
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        EXPECT_EQ(came_, c.written);
        const VideoSourceCounters k = bridge_->counters();
        std::printf("%d sent: %d written, %d failed; bridge: %d whole, %d cut short, %d missing\n",
                    static_cast<int>(sent), static_cast<int>(c.written), static_cast<int>(c.failed),
                    static_cast<int>(k.received), static_cast<int>(k.truncated), static_cast<int>(k.lost));
        EXPECT_LE(k.truncated, c.failed);
    }

    VideoFormat format_;
    std::unique_ptr<BridgeDevice> bridge_;
    std::unique_ptr<FaultyDevice> faulty_;
    std::unique_ptr<VideoSink> sink_;
    std::atomic<std::uint64_t> came_{0};

private:
    void read() {
        std::vector<std::uint8_t> pixels(frame_bytes(format_));
        BulkFrameHeader h;
        while (!ending_) {
            if (!bridge_->receive(pixels, h, 10'000'000, [this] { server_->wake(); })) continue;
            ++came_;
            EXPECT_EQ(pixels, picture(h.number)) << h.number;
            EXPECT_EQ(h.t_ns, time_of(h.number));
        }
    }

    std::atomic<bool> ending_{false};
    std::thread reader_;
};

TEST_F(UsbHostBulk, FramesAreByteIdenticalWithNumberAndTime) {
    for (const VideoFormat& format : {kFiveTransfers, kWholePackets}) {
        came_ = 0;
        open(format);
        for (std::uint32_t k = 0; k < 20; ++k) send(k);
        expect_all_accounted(20);
        EXPECT_EQ(sink_->counters().written, 20u);
        EXPECT_EQ(bridge_->counters().lost + bridge_->counters().truncated, 0u);
        close();
    }
}

class UsbHostBulkFaults : public UsbHostBulk, public testing::WithParamInterface<UsbFault> {};

TEST_P(UsbHostBulkFaults, CostTheirFrameAlone) {
    open(kFiveTransfers, GetParam(), 20);
    std::uint32_t k = 0;
    for (; k < 40; ++k) send(k);
    for (const std::uint64_t written = settled(k).written; settled(k).written == written;)
        send(k++);  // the last frame comes, so that every gap is seen
    expect_all_accounted(k);
    EXPECT_EQ(bridge_->counters().lost, sink_->counters().failed) << "each frame that failed is a gap";
    EXPECT_GE(sink_->counters().failed, 10u) << "every tenth transfer, five a frame";
    EXPECT_LE(sink_->counters().failed, 24u);
    EXPECT_EQ(sink_->counters().reconnects, 0u);
}

INSTANTIATE_TEST_SUITE_P(Faults, UsbHostBulkFaults, testing::Values(UsbFault::stall_out, UsbFault::shorten_out));

TEST_F(UsbHostBulk, AHungBridgeCostsFramesAndNoTime) {
    open(kFiveTransfers, UsbFault::hang, 11);  // what ends a frame of before, then two frames
    for (std::uint32_t k = 0; k < 2; ++k) send(k);
    EXPECT_EQ(settled(2).written, 2u);
    for (std::uint32_t k = 2; k < 5; ++k) send(k);
    sink_->flush();
    expect_all_accounted(5);
    EXPECT_EQ(sink_->counters().written, 2u);
    EXPECT_EQ(sink_->counters().failed, 3u);
}

TEST_F(UsbHostBulk, PulledOutAndPutBackTheLossesAreCounted) {
    open(kFiveTransfers);
    std::uint32_t k = 0;
    for (std::uint64_t turn = 1; turn <= 2; ++turn) {
        for (int i = 0; i < 5; ++i) send(k++);
        const VideoCounters before = settled(k);
        port_.reset();
        for (int i = 0; i < 5; ++i) send(k++);
        EXPECT_EQ(settled(k).written, before.written);
        EXPECT_EQ(sink_->counters().failed, before.failed + 5);
        plug_in();
        for (const std::int64_t until_ns = monotonic_ns() + 60 * kSecond_ns;
             settled(k).written == before.written && monotonic_ns() < until_ns;) {
            send(k++);
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
        }
        EXPECT_EQ(sink_->counters().reconnects, turn);
    }
    expect_all_accounted(k);
    EXPECT_EQ(bridge_->counters().lost, sink_->counters().failed);
}

TEST_F(UsbHostBulk, OtherDevicesAreNotTaken) {
    open(kWholePackets);
    const auto other = open_video_sink("bulk:nobody", format_, WhenFull::drop);
    ASSERT_FALSE(other);
    EXPECT_NE(other.error().what.find("there is bulk:NARPA-BRIDGE"), std::string::npos) << other.error().what;
    const auto id = open_video_sink("bulk:1209:0003/", format_, WhenFull::drop);
    ASSERT_FALSE(id);
    EXPECT_NE(id.error().what.find("no USB frame bridge is plugged in"), std::string::npos) << id.error().what;
    const auto second = open_video_sink("bulk:1209:0002/NARPA-BRIDGE", format_, WhenFull::drop);
    ASSERT_FALSE(second);
    EXPECT_FALSE(second.error().remedy.empty()) << second.error().what;
}

}  // namespace
}  // namespace narpa
