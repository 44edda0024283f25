// Two buses that stand for one: each frame once from whichever brings it, and the change to the other one.
#include <gtest/gtest.h>

#include "drivers/can/client_hub.h"
#include "drivers/can/redundant_bus.h"
#include "tests/drivers/can_support.h"

namespace narpa {
namespace {

/// A bus of the test's making: what `in` has is received, `out` has what was sent.
class TestBus final : public CanBus {
public:
    explicit TestBus(std::string name) : name_(std::move(name)) {}
    bool receive(ReceivedFrame& frame) noexcept override {
        if (in.empty()) return false;
        frame = in.front();
        in.erase(in.begin());
        ++counters_.received;
        return true;
    }
    bool send(const CanFrame& frame) noexcept override {
        if (!cut) out.push_back(frame);
        ++(cut ? counters_.send_drops : counters_.sent);
        return !cut;
    }
    void wait(std::int64_t) noexcept override {}
    bool carries_fd() const noexcept override { return fd; }
    std::string description() const override { return name_; }

    std::vector<ReceivedFrame> in{};
    std::vector<CanFrame> out{};
    bool cut = false, fd = true;

private:
    std::string name_;
};

class RedundantBuses : public testing::Test {
protected:
    RedundantBuses() {
        auto a = std::make_unique<TestBus>("A"), b = std::make_unique<TestBus>("B");
        a_ = a.get(), b_ = b.get();
        both_ = make_redundant(std::move(a), std::move(b));
    }
    /// A frame with this number comes on a bus at a time.
    static void come(TestBus& bus, int number, std::int64_t t_ns, std::uint32_t id = 0x123) {
        bus.in.push_back({can_frame(id, {static_cast<std::uint8_t>(number)}), t_ns});
    }
    std::vector<int> received() {
        std::vector<int> numbers;
        for (ReceivedFrame out; both_->receive(out);) numbers.push_back(out.frame.data[0]);
        return numbers;
    }
    TestBus *a_, *b_;
    std::unique_ptr<CanBus> both_;
};

using Numbers = std::vector<int>;

TEST_F(RedundantBuses, HotTakesEachFrameOnceFromWhichever) {
    for (int i = 0; i < 5; ++i) come(*a_, i, i), come(*b_, i, i + 1);
    EXPECT_EQ(received(), (Numbers{0, 1, 2, 3, 4}));
    come(*b_, 5, 10);
    EXPECT_EQ(received(), Numbers{5}) << "B is ahead";
    come(*a_, 5, 11), come(*a_, 6, 12);
    EXPECT_EQ(received(), Numbers{6});
    a_->in.clear();  // A is cut
    for (int i = 6; i < 9; ++i) come(*b_, i, 20 + i);
    EXPECT_EQ(received(), (Numbers{7, 8}));
    const auto uses = both_->uses();
    ASSERT_EQ(uses.size(), 2u);
    EXPECT_EQ(uses[0].used + uses[1].used, 9u);
    EXPECT_EQ(uses[0].duplicates + uses[1].duplicates, 7u);
    EXPECT_EQ(both_->counters().received, 9u);
}

TEST_F(RedundantBuses, HotKeepsFramesThatASenderRepeats) {
    for (int i = 0; i < 3; ++i) come(*a_, 7, i);
    EXPECT_EQ(received(), (Numbers{7, 7, 7}));
    for (int i = 0; i < 3; ++i) come(*b_, 7, i + 3);
    EXPECT_EQ(received(), Numbers{});
    come(*b_, 7, 9);
    EXPECT_EQ(received(), Numbers{7}) << "a fourth one";
}

TEST_F(RedundantBuses, HotForgetsFramesAfterASecond) {
    come(*a_, 1, 0);
    EXPECT_EQ(received(), Numbers{1});
    come(*b_, 1, 2 * kSecond_ns);
    EXPECT_EQ(received(), Numbers{1}) << "another frame with the same bytes";
}

TEST_F(RedundantBuses, HotSendsOnBothAndCountsAFrameThatNeitherTakes) {
    EXPECT_TRUE(both_->send(can_frame(1, {1})));
    a_->cut = true;
    EXPECT_TRUE(both_->send(can_frame(1, {2})));
    b_->cut = true;
    EXPECT_FALSE(both_->send(can_frame(1, {3})));
    EXPECT_EQ(a_->out.size(), 1u);
    EXPECT_EQ(b_->out.size(), 2u);
    EXPECT_EQ(both_->counters().sent, 2u);
    EXPECT_EQ(both_->counters().send_drops, 1u);
    EXPECT_TRUE(both_->carries_fd());
    b_->fd = false;
    EXPECT_FALSE(both_->carries_fd());
}

TEST_F(RedundantBuses, ColdTakesTheOtherBusWhenItsMasterIsHeardThere) {
    constexpr std::uint32_t kMaster = 0x77F;
    both_->set_redundancy({.is_cold = true, .heartbeat_id = kMaster, .heartbeat_timeout_ns = 100});
    const auto send = [&](int number) {
        EXPECT_TRUE(both_->send(can_frame(9, {static_cast<std::uint8_t>(number)})));
    };
    come(*a_, 1, 1000, kMaster), come(*a_, 2, 1010), come(*b_, 3, 1020);
    EXPECT_EQ(received(), (Numbers{1, 2})) << "B is not in use";
    send(1);
    come(*b_, 4, 1090, kMaster);
    EXPECT_EQ(received(), Numbers{}) << "the master was heard on A 90 ns ago";
    come(*b_, 5, 1101), come(*b_, 6, 1102, kMaster), come(*b_, 7, 1103);
    EXPECT_EQ(received(), (Numbers{6, 7})) << "its heartbeat changes the bus, other frames do not";
    EXPECT_EQ(both_->switches(), 1u);
    come(*a_, 8, 1110);
    EXPECT_EQ(received(), Numbers{});
    send(2);
    EXPECT_EQ(a_->out.size(), 1u);
    EXPECT_EQ(b_->out.size(), 1u);
    come(*a_, 9, 1300, kMaster);
    EXPECT_EQ(received(), Numbers{9}) << "and back";
    EXPECT_EQ(both_->switches(), 2u);
    EXPECT_EQ(both_->uses()[0].idle, 1u);
    EXPECT_EQ(both_->uses()[1].idle, 3u);
}

TEST(RedundantBusTexts, AreTwoBusesJoinedByAPlusSign) {
    EXPECT_EQ(redundant_parts("vcan0+vcan1"), (std::vector<std::string>{"vcan0", "vcan1"}));
    EXPECT_EQ(redundant_parts("slcan:0+udp:239.74.163.2"),
              (std::vector<std::string>{"slcan:0", "udp:239.74.163.2"}));
    for (const char* one : {"vcan0", "log:a+b", "vcan0+", "vcan0+log:a", "vcan0+vcan1+vcan2"})
        EXPECT_TRUE(redundant_parts(one).empty()) << one;
    for (const char* bad : {"vcan0+vcan0", "vcan0+log:a", "vcan0+vcan1+vcan2"})
        EXPECT_FALSE(open_can_bus(bad, CanRole::hub)) << bad;
}

TEST(RedundantBusOfHubs, ServesClientsOfBothAndOutlivesOne) {
    const auto hub = open_or_fail("slcan:0+slcan:0", CanRole::hub);
    ASSERT_TRUE(hub);
    const std::string address = hub->address().bus;
    auto opening = std::async(std::launch::async, [&] { return open_or_fail(address, CanRole::client); });
    turn_until(*hub, [&] {
        ReceivedFrame out;
        EXPECT_FALSE(hub->receive(out));
        return opening.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    });
    const auto client = opening.get();
    ASSERT_TRUE(client);
    ReceivedFrame out;
    for (int i = 0; i < 10; ++i) {
        EXPECT_TRUE(client->send(can_frame(0x123, {static_cast<std::uint8_t>(i)})));
        ASSERT_TRUE(next_frame(*hub, out));
        EXPECT_EQ(out.frame.data[0], i);
        EXPECT_TRUE(hub->send(can_frame(0x124, {static_cast<std::uint8_t>(i)})));
        ASSERT_TRUE(next_frame(*client, out));
        EXPECT_EQ(out.frame.data[0], i);
    }
    ASSERT_NE(hub->clients(), nullptr);
    hub->clients()->note_commander();
    EXPECT_TRUE(hub->clients()->has_clients());
    EXPECT_FALSE(hub->clients()->commanders_left());
}

}  // namespace
}  // namespace narpa
