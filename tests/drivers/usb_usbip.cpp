// The USB/IP server and the adapter in software against a host that speaks USB/IP, with no kernel between them.
#include <thread>

#include "drivers/usb/faulty_device.h"
#include "drivers/usb/gs_usb_device.h"
#include "drivers/usb/usbip_server.h"
#include "tests/drivers/can_support.h"
#include "tests/drivers/usbip_client.h"

namespace narpa {
namespace {

constexpr UsbSetup kStart{0x41, static_cast<std::uint8_t>(GsUsbRequest::mode), 0, 0, 8};

/// An adapter on one member of a bus; `peer` is another.
class UsbIpAdapter : public testing::Test {
protected:
    void serve(UsbFault fault = UsbFault::none, std::uint64_t after = 0) {
        bus_ = open_or_fail("udp:" + own_group(), CanRole::hub);
        peer_ = open_or_fail("udp:" + own_group(), CanRole::client);
        ASSERT_TRUE(bus_ && peer_);
        faulty_ = std::make_unique<FaultyDevice>(adapter_, fault, after);
        auto server = UsbIpServer::start("127.0.0.1", 0, *faulty_);
        ASSERT_TRUE(server) << server.error().text();
        server_ = *std::move(server);
        can_ = std::thread([this] {
            while (!ending_)
                if (adapter_.turn(*bus_, 10'000'000)) server_->wake();
        });
    }
    void TearDown() override {
        ending_ = true;
        if (can_.joinable()) can_.join();
    }
    /// A host with a started channel.
    UsbIpClient host(std::uint32_t features = GsUsbFeature::kFd) {
        UsbIpClient c(server_->port());
        EXPECT_EQ(c.import(), 0u);
        EXPECT_EQ(c.tell(kStart, encode_gs_usb_mode({true, features})).reply.status, 0);
        return c;
    }
    std::vector<std::uint8_t> bytes_of(const CanFrame& frame, std::uint32_t echo) {
        GsUsbFrame f;
        f.echo = echo;
        f.frame = frame;
        std::array<std::uint8_t, kGsUsbFrameMostBytes> b{};
        const std::size_t n = encode_gs_usb_frame(f, false, b);
        return {b.begin(), b.begin() + static_cast<std::ptrdiff_t>(n)};
    }
    /// Waits for a frame of the bus or an echo.
    GsUsbFrame read_frame(UsbIpClient& c, bool with_time = false) {
        c.begin(GsUsbDevice::kIn, true, 512);
        const auto done = c.next(true);
        const auto f = decode_gs_usb_frame(done.data, with_time);
        EXPECT_TRUE(f) << done.reply.status << " " << done.data.size();
        return f.value_or(GsUsbFrame{});
    }

    GsUsbDevice adapter_{"TEST1", true};
    std::unique_ptr<CanBus> bus_, peer_;
    std::unique_ptr<FaultyDevice> faulty_;
    std::unique_ptr<UsbIpServer> server_;
    std::atomic<bool> ending_{false};
    std::thread can_;
};

TEST_F(UsbIpAdapter, IsListedAndTakenByOneHostAtATime) {
    serve();
    UsbIpClient lists(server_->port());
    lists.send(encode_usbip_op({UsbIpOp::list_request, 0}));
    const auto list = lists.receive(8 + 4 + 312 + 4);
    ASSERT_EQ(list.size(), 8u + 4 + 312 + 4);
    EXPECT_EQ(list[12 + 300], 0x1d);
    EXPECT_TRUE(lists.is_over());
    EXPECT_EQ(UsbIpClient(server_->port()).import("9-9"), kUsbIpNoDevice);
    {
        UsbIpClient first(server_->port());
        EXPECT_EQ(first.import(), 0u);
        EXPECT_EQ(UsbIpClient(server_->port()).import(), kUsbIpBusy);
    }
    while (UsbIpClient(server_->port()).import() == kUsbIpBusy) {  // until the server has seen it leave
    }
    EXPECT_GE(server_->counters().plugged, 2u);
}

TEST_F(UsbIpAdapter, AnswersWhatAHostAsksAtTheStart) {
    serve();
    UsbIpClient c(server_->port());
    ASSERT_EQ(c.import(), 0u);
    const auto device = decode_usb_device(c.ask({0x80, 6, 0x0100, 0, 18}).data);
    ASSERT_TRUE(device);
    EXPECT_EQ(device->product, 0x606f);
    EXPECT_EQ(c.ask({0x80, 6, 0x0200, 0, 9}).data.size(), 9u) << "no more than asked for";
    EXPECT_TRUE(decode_usb_configuration(c.ask({0x80, 6, 0x0200, 0, 255}).data));
    EXPECT_EQ(c.ask({0x80, 6, 0x0303, 0x0409, 255}).data, encode_usb_string("TEST1"));
    EXPECT_EQ(c.ask({0x80, 6, 0x03ff, 0x0409, 255}).reply.status, UsbAnswer::kStall);
    EXPECT_EQ(c.ask({0x80, 6, 0x0600, 0, 10}).reply.status, UsbAnswer::kStall)
        << "a full-speed device has one speed";
    EXPECT_EQ(c.tell({0, 9, 1, 0, 0}, {}).reply.status, 0);
    EXPECT_EQ(c.tell({0x41, 0, 1, 0, 4}, kGsUsbHostFormat).reply.status, 0);
    EXPECT_EQ(decode_gs_usb_config(c.ask({0xc1, 5, 1, 0, 12}).data), GsUsbConfig{});
    const auto limits = decode_gs_usb_limits(c.ask({0xc1, 4, 0, 0, 40}).data);
    ASSERT_TRUE(limits);
    EXPECT_TRUE((limits->features & GsUsbFeature::kFd) != 0);
    const auto both = decode_gs_usb_limits(c.ask({0xc1, 11, 0, 0, 72}).data);
    ASSERT_TRUE(both && both->data);
    const auto timing = bit_timing_of(500'000, limits->clock_hz, limits->nominal);
    ASSERT_TRUE(timing);
    EXPECT_EQ(c.tell({0x41, 1, 0, 0, 20}, encode_gs_usb_bit_timing(*timing)).reply.status, 0);
    EXPECT_EQ(c.tell({0x41, 1, 0, 0, 20}, encode_gs_usb_bit_timing({})).reply.status, UsbAnswer::kStall);
    EXPECT_EQ(c.tell(kStart, encode_gs_usb_mode({true, 1u << 31})).reply.status, UsbAnswer::kStall);
    EXPECT_FALSE(adapter_.started());
    EXPECT_EQ(c.tell(kStart, encode_gs_usb_mode({true, 0})).reply.status, 0);
    EXPECT_TRUE(adapter_.started());
}

TEST_F(UsbIpAdapter, CarriesFramesBothWaysAndSendsEchoes) {
    serve();
    UsbIpClient c = host(GsUsbFeature::kFd | GsUsbFeature::kTimeStamp);
    ReceivedFrame out;
    const std::vector<CanFrame> kinds{can_frame(0x123, {1, 2, 3}), can_frame(0x1fffffff, {}, true),
                                      remote_frame(0x321, 4),
                                      fd_frame(0x10f, std::vector<std::uint8_t>(64, 7), true)};
    for (std::uint32_t i = 0; i < kinds.size(); ++i) {
        const auto bytes = bytes_of(kinds[i], i);
        c.begin(GsUsbDevice::kOut, false, static_cast<std::uint32_t>(bytes.size()), {}, bytes);
        EXPECT_EQ(c.next(false).reply.length, bytes.size());
        const GsUsbFrame echo = read_frame(c, true);
        EXPECT_EQ(echo.echo, i);
        ASSERT_TRUE(next_frame(*peer_, out));
        EXPECT_TRUE(same(out.frame, kinds[i])) << i;
        ASSERT_TRUE(peer_->send(kinds[i]));
        const GsUsbFrame back = read_frame(c, true);
        EXPECT_EQ(back.echo, GsUsbFrame::kReceived);
        EXPECT_TRUE(same(back.frame, kinds[i])) << i;
        EXPECT_NE(back.time_us, 0u);
    }
    EXPECT_EQ(adapter_.counters().from_host, kinds.size());
    EXPECT_EQ(adapter_.counters().to_host, kinds.size());
}

TEST_F(UsbIpAdapter, TransfersAreGivenUpAndCounted) {
    serve();
    UsbIpClient c = host();
    const std::uint32_t victim = c.begin(GsUsbDevice::kIn, true, 512);
    const std::uint32_t unlink = c.unlink(victim);
    EXPECT_EQ(c.next(true).reply, (UsbIpReply{true, unlink, -104, 0}));
    EXPECT_EQ(server_->counters().unlinked, 1u);
    const std::uint32_t again = c.unlink(victim);
    EXPECT_EQ(c.next(true).reply, (UsbIpReply{true, again, 0, 0})) << "it is not there any more";
}

TEST_F(UsbIpAdapter, EachFrameOfTheBusIsCountedOnceHowTheHostEverBehaves) {
    serve();
    std::uint64_t sent = 0;
    const auto flood = [&](int n) {
        for (int i = 0; i < n; ++i, ++sent) ASSERT_TRUE(peer_->send(can_frame(0x100, {1})));
    };
    const auto seen = [&] {
        const GsUsbDeviceCounters k = adapter_.counters();
        return k.to_host + k.missed + k.overflow + bus_->counters().receive_overflow;
    };
    flood(100);  // nobody listens
    {
        UsbIpClient c = host();
        flood(50);
        for (int i = 0; i < 20; ++i) (void)read_frame(c);
    }  // pulled out with 30 frames in the adapter
    flood(50);
    for (const std::int64_t until_ns = monotonic_ns() + 60 * kSecond_ns;
         seen() < sent && monotonic_ns() < until_ns;)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_EQ(seen(), sent);
    EXPECT_GE(adapter_.counters().to_host, 20u);
}

TEST_F(UsbIpAdapter, BusOffHoldsUntilTheChannelIsStartedAgain) {
    adapter_.bus_off_after(2);
    serve();
    UsbIpClient c = host();
    const auto put = [&](std::uint32_t echo) {
        const auto bytes = bytes_of(can_frame(0x1, {1}), echo);
        c.begin(GsUsbDevice::kOut, false, static_cast<std::uint32_t>(bytes.size()), {}, bytes);
        EXPECT_EQ(c.next(false).reply.status, 0);
    };
    put(0), put(1);
    EXPECT_EQ(read_frame(c).echo, 0u);
    EXPECT_EQ(read_frame(c).echo, 1u);
    const GsUsbFrame report = read_frame(c);
    EXPECT_TRUE(report.frame.error);
    EXPECT_EQ(report.frame.id, CanErrorClass::kBusOff);
    const UsbSetup state{0xc1, static_cast<std::uint8_t>(GsUsbRequest::state), 0, 0, 12};
    EXPECT_EQ(c.ask(state).data[0], 3) << "bus-off";
    EXPECT_EQ(c.tell(kStart, encode_gs_usb_mode({true, 0})).reply.status, 0);
    put(2);
    EXPECT_EQ(read_frame(c).echo, 2u);
    EXPECT_EQ(adapter_.counters().bus_off, 1u);
}

TEST_F(UsbIpAdapter, FaultsAreWhatTheyAreCalled) {
    serve(UsbFault::stall, 0);
    UsbIpClient c = host();
    int stalls = 0;
    for (int i = 0; i < 20; ++i) {
        ASSERT_TRUE(peer_->send(can_frame(0x100, {1})));
        c.begin(GsUsbDevice::kIn, true, 512);
        stalls += c.next(true).reply.status == UsbAnswer::kStall;
    }
    EXPECT_EQ(stalls, 2);
}

TEST_F(UsbIpAdapter, JunkEndsItsConnectionAndNoOther) {
    serve();
    UsbIpClient good = host();
    for (const std::string text : {"GET / HTTP/1.0\r\n\r\n", "\x01\x11\x80\x06xxxx"}) {
        UsbIpClient junk(server_->port());
        junk.send({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
        EXPECT_TRUE(junk.is_over());
    }
    EXPECT_EQ(server_->counters().refused, 2u);
    ASSERT_TRUE(peer_->send(can_frame(0x77, {1})));
    EXPECT_EQ(read_frame(good).frame.id, 0x77u);
    good.send(std::vector<std::uint8_t>(kUsbIpHeaderBytes, 0xff));
    EXPECT_TRUE(good.is_over());
}

TEST(UsbIpServer, AddressesAreChecked) {
    GsUsbDevice device("X", false);
    EXPECT_FALSE(UsbIpServer::start("nowhere", 0, device));
    auto first = UsbIpServer::start("127.0.0.1", 0, device);
    ASSERT_TRUE(first);
    const auto second = UsbIpServer::start("127.0.0.1", (*first)->port(), device);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().kind, ErrorKind::missing);
    for (const char* bad : {"", "x", ":1", "1.2.3:5", "127.0.0.1:", "127.0.0.1:70000"})
        EXPECT_FALSE(parse_listen_address(bad)) << bad;
    ASSERT_TRUE(parse_listen_address("0.0.0.0:3240"));
    EXPECT_EQ(parse_listen_address("3240")->host, "127.0.0.1");
}

}  // namespace
}  // namespace narpa
