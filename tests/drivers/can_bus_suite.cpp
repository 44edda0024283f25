// One suite for every bus: what one side sends, the other receives.
#include <fcntl.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <memory>

#include "drivers/can/slcan_stream.h"
#include "tests/drivers/can_support.h"

namespace narpa {
namespace {

/// The program at the other end of the pty.
class PtyClient final : public CanBus {
public:
    explicit PtyClient(const std::string& path) {
        stream_.attach(Descriptor(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)));
        EXPECT_TRUE(stream_.write("C\rS6\rO\r"));
    }
    bool receive(ReceivedFrame& out) noexcept override {
        std::string_view line;
        for (;;) {
            while (stream_.next_line(line))
                if (decode_slcan(line, out.frame)) return true;
            stream_.flush();
            if (!stream_.read() || !stream_.unread()) return false;
        }
    }
    bool send(const CanFrame& frame) noexcept override {
        std::array<char, kSlcanMaxLine> line;
        const std::size_t n = encode_slcan(frame, line);
        return n > 0 && stream_.write({line.data(), n});
    }
    void wait(std::int64_t timeout_ns) noexcept override {
        std::array<pollfd, 1> fds{{{stream_.fd(), POLLIN, 0}}};
        wait_ready(fds, timeout_ns);
        stream_.flush();
    }
    bool carries_fd() const noexcept override { return false; }
    std::string description() const override { return "pty"; }

private:
    SlcanStream stream_{};
};

/// Two sides of one bus.
struct Pair {
    std::unique_ptr<CanBus> hub, peer;
    std::string missing{};  ///< why this machine cannot have such a bus
};

Pair slcan_tcp() {
    Pair p;
    p.hub = open_or_fail("slcan:0", CanRole::hub);
    p.peer = open_client_of(*p.hub);
    return p;
}

Pair slcan_pty() {
    Pair p;
    p.hub = open_or_fail("slcan:0", CanRole::hub);
    p.peer = std::make_unique<PtyClient>(hub_pty(*p.hub));
    return p;
}

Pair udp() {
    Pair p;
    p.hub = open_or_fail("udp:" + own_group(), CanRole::hub);
    p.peer = open_or_fail("udp:" + own_group(), CanRole::client);
    return p;
}

Pair memory() {
    static int opened = 0;
    const std::string spec = "memory:suite-" + std::to_string(opened++);
    Pair p;
    p.peer = open_or_fail(spec, CanRole::client);
    p.hub = open_or_fail(spec, CanRole::hub);
    return p;
}

Pair socketcan() {
    const char* interface = std::getenv("NARPA_TEST_CAN");
    if (interface == nullptr) return {nullptr, nullptr, "NARPA_TEST_CAN names no CAN interface"};
    Pair p;
    p.hub = open_or_fail(interface, CanRole::hub);
    p.peer = open_or_fail(interface, CanRole::client);
    return p;
}

/// The adapter's bus is NARPA_TEST_CAN's.
Pair usb() {
    const char* adapter = std::getenv("NARPA_TEST_USB");
    if (adapter == nullptr) return {nullptr, nullptr, "NARPA_TEST_USB names no USB-CAN adapter"};
    Pair p;
    p.hub = open_or_fail(adapter, CanRole::hub);
    p.peer = open_or_fail(std::getenv("NARPA_TEST_CAN"), CanRole::client);
    return p;
}

struct Kind {
    const char* name;
    Pair (*open)();
    bool reliable;
    bool exclusive = false;  ///< one program, and one time in it
};
void PrintTo(const Kind& kind, std::ostream* out) {
    *out << kind.name;
}

class CanBusSuite : public testing::TestWithParam<Kind> {
protected:
    void SetUp() override {
        pair_ = GetParam().open();
        if (!pair_.missing.empty()) GTEST_SKIP() << pair_.missing;
        ASSERT_TRUE(pair_.hub && pair_.peer);
        // A client takes part once the hub has read its O; on the other buses both sides do from the start.
        ReceivedFrame out;
        const CanFrame hello = can_frame(0x7E0, {0x55});
        EXPECT_TRUE(pair_.peer->send(hello));
        ASSERT_TRUE(next_frame(*pair_.hub, out));
        ASSERT_TRUE(same(out.frame, hello));
    }
    CanBus& hub() { return *pair_.hub; }
    CanBus& peer() { return *pair_.peer; }
    void close() { pair_ = {}; }

private:
    Pair pair_;
};

const std::vector<CanFrame> kClassicKinds{
    can_frame(0x000, {}),
    can_frame(0x7FF, {0xFF}),
    can_frame(0x123, {0xDE, 0xAD, 0xBE, 0xEF}),
    can_frame(0x100, {0, 1, 2, 3, 4, 5, 6, 7}),
    can_frame(0x123, {1}, true),
    can_frame(0x1FFFFFFF, {8, 7, 6, 5, 4, 3, 2, 1}, true),
    can_frame(0, {}, true),
    remote_frame(0x321, 0),
    remote_frame(0x321, 8),
    remote_frame(0x18FF50E5, 3, true),
};

TEST_P(CanBusSuite, CarriesEveryClassicKindBothWays) {
    for (const CanFrame& f : kClassicKinds) {
        ReceivedFrame out;
        ASSERT_TRUE(peer().send(f));
        ASSERT_TRUE(next_frame(hub(), out)) << std::hex << f.id;
        EXPECT_TRUE(same(out.frame, f)) << std::hex << f.id;
        EXPECT_GT(out.t_received_ns, 0);
        ASSERT_TRUE(hub().send(f));
        ASSERT_TRUE(next_frame(peer(), out)) << std::hex << f.id;
        EXPECT_TRUE(same(out.frame, f)) << std::hex << f.id;
    }
    EXPECT_EQ(hub().counters().received, kClassicKinds.size() + 1);
    EXPECT_EQ(hub().counters().sent, kClassicKinds.size());
    EXPECT_EQ(hub().counters().malformed, 0u);
}

TEST_P(CanBusSuite, ReceiveStampsAreMonotonicTime) {
    const std::int64_t t_before_ns = monotonic_ns();
    ReceivedFrame out;
    ASSERT_TRUE(peer().send(can_frame(0x10, {1})));
    ASSERT_TRUE(next_frame(hub(), out));
    // The kernel's stamp is carried over from another clock; that costs less than a millisecond.
    EXPECT_GE(out.t_received_ns, t_before_ns - 1'000'000);
    EXPECT_LE(out.t_received_ns, monotonic_ns());
}

TEST_P(CanBusSuite, DoesNotHearItself) {
    ReceivedFrame out;
    ASSERT_TRUE(hub().send(can_frame(0x11, {1})));
    ASSERT_TRUE(next_frame(peer(), out));
    ASSERT_TRUE(peer().send(can_frame(0x12, {2})));
    ASSERT_TRUE(next_frame(hub(), out));
    EXPECT_EQ(out.frame.id, 0x12u);
    EXPECT_FALSE(hub().receive(out));
    EXPECT_FALSE(peer().receive(out));
}

TEST_P(CanBusSuite, FdFramesArePaddedOrCounted) {
    std::vector<std::uint8_t> data(13);
    for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::uint8_t>(i + 1);
    const CanFrame f = fd_frame(0x10F, data, true);
    const std::uint64_t drops = hub().counters().send_drops;
    EXPECT_EQ(hub().send(f), hub().carries_fd());
    if (!hub().carries_fd()) {
        EXPECT_EQ(hub().counters().send_drops, drops + 1);
        return;
    }
    ReceivedFrame out;
    ASSERT_TRUE(next_frame(peer(), out));
    EXPECT_TRUE(out.frame.fd && out.frame.bit_rate_switch);
    EXPECT_EQ(out.frame.size, 16);
    EXPECT_EQ(out.frame.data, f.data);
    ASSERT_TRUE(peer().send(fd_frame(0x10F, std::vector<std::uint8_t>(64, 0xA5), false)));
    ASSERT_TRUE(next_frame(hub(), out));
    EXPECT_EQ(out.frame.size, 64);
    EXPECT_FALSE(out.frame.bit_rate_switch);
}

TEST_P(CanBusSuite, ImpossibleFramesAreDroppedAndCounted) {
    CanFrame long_one = can_frame(0x1, {1});
    long_one.size = 9;
    CanFrame error = can_frame(0x1, {1});
    error.error = true;
    const std::uint64_t drops = hub().counters().send_drops;
    for (const CanFrame& f : {can_frame(0x800, {1}), can_frame(0x20000000, {1}, true), long_one, error})
        EXPECT_FALSE(hub().send(f));
    EXPECT_EQ(hub().counters().send_drops, drops + 4);
}

TEST_P(CanBusSuite, BurstOf3000) {
    constexpr std::uint32_t n = 3000;
    std::uint32_t sent = 0, got = 0, in_order = 0;
    ReceivedFrame out;
    while (sent < n) {
        const auto byte = [&](int i) { return static_cast<std::uint8_t>(sent >> (8 * i)); };
        ASSERT_TRUE(peer().send(can_frame(0x100, {byte(0), byte(1), 0, 0, 0, 0, 0, 0xEE})));
        ++sent;
    }
    const auto drain = [&] {
        for (peer().wait(0); hub().receive(out); ++got) {  // wait also sends what is still queued in the pty client
            const unsigned number = out.frame.data[0] + 256u * out.frame.data[1];
            in_order += number == got ? 1 : 0;
        }
        return got + hub().counters().receive_overflow >= n;
    };
    EXPECT_TRUE(turn_until(hub(), drain)) << got;
    EXPECT_EQ(got + hub().counters().receive_overflow, n) << "a loss is at least counted";
    if (GetParam().reliable) {
        EXPECT_EQ(got, n);
        EXPECT_EQ(in_order, n);
    }
}

TEST_P(CanBusSuite, WaitComesBackWithNothing) {
    ReceivedFrame out;
    hub().wait(0);
    hub().wait(1'000'000);
    EXPECT_FALSE(hub().receive(out));
    EXPECT_FALSE(hub().ended());
    EXPECT_FALSE(hub().recorded());
    EXPECT_FALSE(hub().description().empty());
}

TEST_P(CanBusSuite, ThePeerComesAndGoes) {
    ReceivedFrame out;
    if (GetParam().exclusive) close();
    for (std::uint32_t i = 0; i < 5; ++i) {
        const Pair fresh = GetParam().open();
        ASSERT_TRUE(fresh.hub && fresh.peer);
        ASSERT_TRUE(fresh.peer->send(can_frame(0x20 + i, {1})));
        ASSERT_TRUE(next_frame(*fresh.hub, out));
        EXPECT_EQ(out.frame.id, 0x20 + i);
    }
}

INSTANTIATE_TEST_SUITE_P(Buses, CanBusSuite,
                         testing::Values(Kind{"slcan_tcp", slcan_tcp, true}, Kind{"slcan_pty", slcan_pty, true},
                                         Kind{"udp_multicast", udp, false}, Kind{"memory", memory, true},
                                         Kind{"socketcan", socketcan, true}, Kind{"usb", usb, true, true}),
                         [](const auto& kind) { return std::string(kind.param.name); });

}  // namespace
}  // namespace narpa
