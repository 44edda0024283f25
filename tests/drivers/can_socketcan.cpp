// What only SocketCAN has: controllers that report errors, interfaces that go down, vanish and come back. It needs
// a kernel with CAN (NARPA_TEST_CAN names an interface of it) and root, to make interfaces of its own.
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>

#include <cstdlib>

#include "drivers/descriptor.h"
#include "tests/drivers/can_support.h"

namespace narpa {
namespace {

bool run(const std::string& command) {
    return std::system((command + " 2>/dev/null").c_str()) == 0;
}

class SocketCanDevice : public testing::Test {
protected:
    void SetUp() override {
        if (std::getenv("NARPA_TEST_CAN") == nullptr) GTEST_SKIP() << "NARPA_TEST_CAN names no CAN interface";
        if (!make(72)) GTEST_SKIP() << "cannot make a vcan interface: not root?";
        hub_ = open_or_fail(name_, CanRole::hub);
        peer_ = open_or_fail(name_, CanRole::client);
        ASSERT_TRUE(hub_ && peer_);
    }
    void TearDown() override { (void)run("ip link del " + name_); }

    bool make(int mtu) {
        return run("ip link add dev " + name_ + " type vcan && ip link set " + name_ + " mtu " +
                   std::to_string(mtu) + " up");
    }
    /// Turns both sides until what one sends arrives at the other.
    ::testing::AssertionResult works() {
        const bool arrived = turn_until(*hub_, [&] {
            (void)peer_->send(can_frame(0x155, {1}));
            return hub_->receive(out_) && out_.frame.id == 0x155;
        });
        return arrived ? ::testing::AssertionSuccess() : ::testing::AssertionFailure() << "nothing arrives";
    }

    const std::string name_ = "narpa" + std::to_string(::getpid() % 10000);
    std::unique_ptr<CanBus> hub_, peer_;
    ReceivedFrame out_{};
};

TEST_F(SocketCanDevice, ErrorReportsAreCountedAndNotReturned) {
    const Descriptor fd(::socket(PF_CAN, SOCK_RAW, CAN_RAW));
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(name_.c_str()));
    ASSERT_EQ(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    for (const canid_t what : {CAN_ERR_CRTL, CAN_ERR_BUSOFF, CAN_ERR_ACK | CAN_ERR_BUSOFF}) {
        ::can_frame report{};
        report.can_id = CAN_ERR_FLAG | what;
        report.len = CAN_ERR_DLC;
        ASSERT_EQ(::write(fd.get(), &report, sizeof report), static_cast<ssize_t>(sizeof report));
    }
    ASSERT_TRUE(peer_->send(narpa::can_frame(0x1, {})));
    ASSERT_TRUE(next_frame(*hub_, out_));
    EXPECT_EQ(out_.frame.id, 0x1u);
    EXPECT_EQ(hub_->counters().error_frames, 3u);
    EXPECT_EQ(hub_->counters().bus_off, 2u);
    EXPECT_EQ(hub_->counters().received, 1u);
}

TEST_F(SocketCanDevice, SurvivesDownAndUp) {
    ASSERT_TRUE(works());
    for (std::uint64_t turn = 1; turn <= 3; ++turn) {
        ASSERT_TRUE(run("ip link set " + name_ + " down"));
        EXPECT_FALSE(hub_->receive(out_));
        EXPECT_EQ(hub_->counters().interface_down, turn);
        EXPECT_FALSE(hub_->send(can_frame(0x1, {})));
        EXPECT_EQ(hub_->counters().send_drops, turn);
        ASSERT_TRUE(run("ip link set " + name_ + " up"));
        EXPECT_TRUE(works());
    }
    EXPECT_EQ(hub_->counters().interface_down, 3u);
}

TEST_F(SocketCanDevice, SurvivesRemovalAndANewInterfaceOfTheName) {
    ASSERT_TRUE(hub_->carries_fd());
    ASSERT_TRUE(run("ip link del " + name_));
    EXPECT_FALSE(hub_->receive(out_));
    EXPECT_FALSE(hub_->send(can_frame(0x1, {})));
    hub_->wait(10'000'000);
    EXPECT_EQ(hub_->counters().interface_down, 1u);
    ASSERT_TRUE(make(16));
    EXPECT_TRUE(works());
    EXPECT_FALSE(hub_->carries_fd()) << "the new one is classic";
    EXPECT_FALSE(hub_->send(fd_frame(0x10F, std::vector<std::uint8_t>(64, 1), false)));
    EXPECT_TRUE(hub_->send(can_frame(0x1, {})));
}

TEST_F(SocketCanDevice, LostFramesAreCounted) {
    constexpr std::uint64_t n = 40'000;  // the buffer of 4 MiB holds some 11000
    for (std::uint64_t i = 0; i < n; ++i) ASSERT_TRUE(peer_->send(can_frame(0x100, {1, 2, 3, 4, 5, 6, 7, 8})));
    std::uint64_t got = 0;
    while (hub_->receive(out_)) ++got;
    EXPECT_GE(got, 5000u) << "a burst of a whole second at 1 Mbit/s fits";
    ASSERT_TRUE(peer_->send(can_frame(0x100, {})));  // the next frame brings the count
    ASSERT_TRUE(next_frame(*hub_, out_));
    EXPECT_GT(hub_->counters().receive_overflow, 0u);
    EXPECT_EQ(got + hub_->counters().receive_overflow, n);
}

TEST_F(SocketCanDevice, DownAtTheStartIsSaid) {
    ASSERT_TRUE(run("ip link set " + name_ + " down"));
    const auto bus = open_can_bus(name_, CanRole::hub);
    ASSERT_FALSE(bus);
    EXPECT_EQ(bus.error().kind, ErrorKind::missing);
    EXPECT_NE(bus.error().what.find("down"), std::string::npos) << bus.error().what;
    const auto loopback = open_can_bus("lo", CanRole::hub);
    ASSERT_FALSE(loopback);
    EXPECT_NE(loopback.error().what.find("not a CAN interface"), std::string::npos) << loopback.error().what;
}

}  // namespace
}  // namespace narpa
