// What only a USB-CAN adapter has: it is pulled out, other programs hold it. It needs one (NARPA_TEST_USB names it;
// NARPA_TEST_CAN the interface of the bus behind it) and root. Adapters that misbehave: usb_host.cpp.
#include <gtest/gtest.h>

#include <cstdlib>

#include "drivers/can/usb_adapters.h"
#include "drivers/can/usb_spec.h"
#include "tests/drivers/can_support.h"

namespace narpa {
namespace {

TEST(UsbCanSpec, TextsAreReadOrRefused) {
    const auto spec = parse_usb_can("1-4.2/1@500000,2000000");
    ASSERT_TRUE(spec);
    EXPECT_EQ(*spec, (UsbCanSpec{"1-4.2", 1, 500'000, 2'000'000}));
    EXPECT_EQ(*parse_usb_can(""), UsbCanSpec{});
    EXPECT_EQ(parse_usb_can("NARPA0001@5000000").has_value(), false);
    EXPECT_EQ(parse_usb_can("NARPA0001@1000000")->data_bit_rate, 4'000'000u);
}

class UsbCanDevice : public testing::Test {
protected:
    void SetUp() override {
        const char* usb = std::getenv("NARPA_TEST_USB");
        const char* behind = std::getenv("NARPA_TEST_CAN");
        if (usb == nullptr || behind == nullptr) GTEST_SKIP() << "NARPA_TEST_USB names no USB-CAN adapter";
        usb_ = open_or_fail(usb, CanRole::hub);
        peer_ = open_or_fail(behind, CanRole::client);
        ASSERT_TRUE(usb_ && peer_);
    }
    static bool shell(const char* variable) {
        const char* command = std::getenv(variable);
        return command != nullptr && std::system(command) == 0;
    }
    /// Until a frame passes.
    void expect_it_works() {
        ReceivedFrame out;
        EXPECT_TRUE(turn_until(*usb_, [&] {
            (void)peer_->send(can_frame(0x155, {1}));
            return usb_->receive(out) && out.frame.id == 0x155;
        }));
    }

    std::unique_ptr<CanBus> usb_, peer_;
};

/// Sends `n` numbered frames, never more than `window` ahead of the reader. Returns how many came, in order.
std::uint32_t stream(CanBus& from, CanBus& to, std::uint32_t n, std::uint32_t window, bool fd) {
    std::uint32_t sent = 0, got = 0;
    ReceivedFrame out;
    const auto number = [](const CanFrame& f) { return f.data[0] | f.data[1] << 8 | f.data[2] << 16; };
    constexpr std::int64_t kTimeout_ns = 120 * kSecond_ns;  // without progress; an emulated machine is slow
    for (std::int64_t until_ns = monotonic_ns() + kTimeout_ns; got < n && monotonic_ns() < until_ns;
         to.wait(10'000'000)) {
        for (; sent < n && sent - got < window; ++sent) {
            const auto byte = [&](int i) { return static_cast<std::uint8_t>(sent >> (8 * i)); };
            const bool is_fd = fd && sent % 2 == 1;
            CanFrame f = is_fd ? fd_frame(0x100, std::vector<std::uint8_t>(64, 0xa5), true)
                               : can_frame(0x100, {0, 0, 0, 0, 0, 0, 0, 0xee});
            for (int i = 0; i < 3; ++i) f.data[static_cast<std::size_t>(i)] = byte(i);
            if (!from.send(f)) break;
        }
        for (; to.receive(out); ++got, until_ns = monotonic_ns() + kTimeout_ns) {
            if (number(out.frame) == static_cast<int>(got) && out.frame.fd == (fd && got % 2 == 1)) continue;
            ADD_FAILURE() << "frame " << number(out.frame) << " came where " << got << " was expected";
            return got;
        }
    }
    return got;
}

TEST_F(UsbCanDevice, CarriesEveryFrameInOrderBothWays) {
    const char* many = std::getenv("NARPA_TEST_USB_FRAMES");
    const auto n = static_cast<std::uint32_t>(many ? std::atoi(many) : 1000);
    const std::int64_t start_ns = monotonic_ns();
    EXPECT_EQ(stream(*peer_, *usb_, n, 500, usb_->carries_fd()), n);
    const std::int64_t turned_ns = monotonic_ns();
    EXPECT_EQ(stream(*usb_, *peer_, n, 500, usb_->carries_fd()), n);
    std::printf(
        "%u frames each way, classic and CAN FD by turns: %.0f frames/s to the host, %.0f frames/s from it\n", n,
        n / to_seconds(turned_ns - start_ns), n / seconds_since(turned_ns));
    EXPECT_EQ(usb_->counters().receive_overflow + usb_->counters().malformed + usb_->counters().send_drops, 0u);
}

TEST_F(UsbCanDevice, IsListedAndHeldByOneProgram) {
    const auto adapters = find_usb_adapters();
    ASSERT_TRUE(adapters) << adapters.error().text();
    ASSERT_EQ(adapters->size(), 1u);
    EXPECT_FALSE((*adapters)[0].serial.empty());
    EXPECT_NE(usb_->description().find((*adapters)[0].serial), std::string::npos) << usb_->description();
    const auto second = open_can_bus(std::getenv("NARPA_TEST_USB"), CanRole::hub);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().kind, ErrorKind::missing);
    EXPECT_FALSE(second.error().remedy.empty()) << second.error().what;
    const auto other = open_can_bus("usb:nobody", CanRole::hub);
    ASSERT_FALSE(other);
    EXPECT_NE(other.error().what.find("there is usb:"), std::string::npos) << other.error().what;
    const auto channel = open_can_bus("usb:/7", CanRole::hub);
    EXPECT_FALSE(channel);
}

TEST_F(UsbCanDevice, PulledOutAndPutBackTheLossesAreCounted) {
    if (std::getenv("NARPA_TEST_USB_UNPLUG") == nullptr) GTEST_SKIP() << "NARPA_TEST_USB_UNPLUG says not how";
    expect_it_works();
    ReceivedFrame out;
    while (usb_->receive(out)) {
    }
    for (std::uint64_t turn = 1; turn <= 2; ++turn) {
        const CanCounters before = usb_->counters();
        ASSERT_TRUE(shell("NARPA_TEST_USB_UNPLUG"));
        EXPECT_TRUE(
            turn_until(*usb_, [&] { return usb_->counters().interface_down == before.interface_down + 1; }));
        for (int i = 0; i < 25; ++i) EXPECT_FALSE(usb_->send(can_frame(0x1, {1})));
        EXPECT_EQ(usb_->counters().send_drops, before.send_drops + 25);
        EXPECT_EQ(usb_->counters().sent, before.sent);
        ASSERT_TRUE(shell("NARPA_TEST_USB_PLUG"));
        expect_it_works();
        EXPECT_TRUE(turn_until(*usb_, [&] { return usb_->send(can_frame(0x2, {2})); }));
        const std::uint64_t drops = usb_->counters().send_drops;
        EXPECT_TRUE(turn_until(*peer_, [&] { return peer_->receive(out) && out.frame.id == 0x2; }));
        EXPECT_EQ(usb_->counters().send_drops, drops);
        while (usb_->receive(out)) {
        }
    }
}

}  // namespace
}  // namespace narpa
