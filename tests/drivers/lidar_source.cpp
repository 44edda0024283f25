// Packets as a navigation program gets them: the real sink sends, the source receives.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <numeric>
#include <thread>

#include "drivers/lidar/packet_sink.h"
#include "drivers/lidar/packet_source.h"
#include "protocols/lidar/velodyne.h"
#include "tests/drivers/video_support.h"

namespace narpa {
namespace {

using test::Bytes;

constexpr std::int64_t kTimeout_ns = 30'000'000'000;  // for what must come

Bytes counted_bytes(std::size_t size, std::size_t first) {
    Bytes bytes(size);
    std::iota(bytes.begin(), bytes.end(), static_cast<std::uint8_t>(first));
    return bytes;
}

/// A source at a free port, and the port.
struct Opened {
    std::unique_ptr<PacketSource> source{};
    int port = 0;
};
Opened open_somewhere(const std::string& address) {
    for (int port = 24'100 + ::getpid() % 400; port < 25'000; ++port) {
        auto source = open_packet_source("udp:" + address + std::to_string(port));
        if (source) return {std::move(*source), port};
        EXPECT_EQ(source.error().kind, ErrorKind::missing) << source.error().text();
    }
    ADD_FAILURE() << "no free port";
    return {};
}
std::unique_ptr<PacketSink> sink_to(int port) {
    auto sink = open_packet_sink("udp:127.0.0.1:" + std::to_string(port), vlp16().network, false);
    EXPECT_TRUE(sink) << sink.error().text();
    return std::move(*sink);
}

TEST(UdpSource, PacketsComeInOrder) {
    for (const std::string address : {"", "127.0.0.1:"}) {
        const Opened at = open_somewhere(address);
        const auto sink = sink_to(at.port);
        Bytes bytes(1500);
        EXPECT_EQ(at.source->receive(bytes, 0), 0U);
        for (std::size_t i = 0; i < 300; ++i) ASSERT_TRUE(sink->send(PacketKind::data, counted_bytes(1206, i), 0));
        for (std::size_t i = 0; i < 300; ++i) {
            bytes.assign(1500, 0);
            ASSERT_EQ(at.source->receive(bytes, kTimeout_ns), 1206U);
            bytes.resize(1206);
            ASSERT_EQ(bytes, counted_bytes(1206, i)) << i;
        }
        EXPECT_EQ(at.source->receive(bytes, 1'000'000), 0U);
        EXPECT_EQ(at.source->counters().received, 300U);
        EXPECT_EQ(at.source->counters().refused, 0U);
    }
}

TEST(UdpSource, WaitsForWhatComesLater) {
    const Opened at = open_somewhere("127.0.0.1:");
    const auto sink = sink_to(at.port);
    std::thread sender([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        sink->send(PacketKind::data, counted_bytes(1206, 1), 0);
    });
    Bytes bytes(1206);
    EXPECT_EQ(at.source->receive(bytes, kTimeout_ns), 1206U);
    sender.join();
}

TEST(UdpSource, WhatIsEmptyOrTooLongIsRefusedAndCounted) {
    const Opened at = open_somewhere("127.0.0.1:");
    const auto sink = sink_to(at.port);
    sink->send(PacketKind::data, {}, 0);
    sink->send(PacketKind::data, counted_bytes(1207, 0), 0);
    sink->send(PacketKind::data, counted_bytes(512, 5), 0);
    Bytes bytes(1206);
    ASSERT_EQ(at.source->receive(bytes, kTimeout_ns), 512U);
    bytes.resize(512);
    EXPECT_EQ(bytes, counted_bytes(512, 5));
    EXPECT_EQ(at.source->counters().refused, 2U);
}

TEST(UdpSource, WhatTheKernelLosesIsCounted) {
    const Opened at = open_somewhere("127.0.0.1:");
    const auto sink = sink_to(at.port);
    constexpr std::uint64_t count = 30'000;  // more than any buffer here holds: 36 MB
    const Bytes packet = counted_bytes(1206, 0);
    for (std::uint64_t i = 0; i < count; ++i) ASSERT_TRUE(sink->send(PacketKind::data, packet, 0));
    Bytes bytes(1206);
    // A packet tells what was lost before it: the first to find room again tells of the flood.
    while (at.source->receive(bytes, 0) > 0) continue;
    ASSERT_TRUE(sink->send(PacketKind::data, packet, 0));
    ASSERT_EQ(at.source->receive(bytes, kTimeout_ns), 1206U);
    EXPECT_GT(at.source->counters().lost, 0U);
    EXPECT_EQ(at.source->counters().received + at.source->counters().lost, count + 1);
}

TEST(PacketSource, BadSourcesSayWhatIsWrong) {
    const Opened taken = open_somewhere("127.0.0.1:");
    const struct {
        std::string spec;
        ErrorKind kind;
        std::string says;
    } cases[] = {
        {"", ErrorKind::bad_input, "expected udp:PORT or udp:ADDRESS:PORT"},
        {"2368", ErrorKind::bad_input, "expected udp:PORT or udp:ADDRESS:PORT"},
        {"udp:", ErrorKind::bad_input, "expected udp:PORT or udp:ADDRESS:PORT"},
        {"udp:0", ErrorKind::bad_input, "with a port from 1 to 65535"},
        {"udp:65536", ErrorKind::bad_input, "with a port from 1 to 65535"},
        {"udp:127.0.0.1:x", ErrorKind::bad_input, "with a port from 1 to 65535"},
        {"udp::2368", ErrorKind::bad_input, "expected udp:PORT or udp:ADDRESS:PORT"},
        {"udp:somewhere:2368", ErrorKind::bad_input, "\"somewhere\" is not an address"},
        {"udp:192.0.2.1:2368", ErrorKind::missing, "ip -br address"},
        {"udp:127.0.0.1:" + std::to_string(taken.port), ErrorKind::missing, "see who has it: ss -lunp"},
    };
    for (const auto& c : cases) {
        const auto source = open_packet_source(c.spec);
        ASSERT_FALSE(source) << c.spec;
        EXPECT_EQ(source.error().kind, c.kind) << c.spec;
        EXPECT_NE(source.error().text().find(c.says), std::string::npos) << source.error().text();
    }
}

}  // namespace
}  // namespace narpa
