#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <fstream>
#include <numeric>

#include "drivers/lidar/packet_sink.h"
#include "drivers/lidar/packet_source.h"
#include "protocols/lidar/velodyne.h"
#include "tests/drivers/video_support.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Bytes;

constexpr int kPositionPortOffset = 8308 - 2368;  // the instrument's two ports

// A UDP socket on loopback; -1 when the port is taken.
class Receiver {
public:
    explicit Receiver(int port) : fd_(::socket(AF_INET, SOCK_DGRAM, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        bound_ = ::bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
        const timeval patience{30, 0};
        ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    }
    ~Receiver() { ::close(fd_); }
    Receiver(const Receiver&) = delete;
    Receiver& operator=(const Receiver&) = delete;

    [[nodiscard]] bool bound() const { return bound_; }
    /// A packet has come.
    [[nodiscard]] bool waits() const {
        std::uint8_t byte = 0;
        return ::recv(fd_, &byte, 1, MSG_DONTWAIT | MSG_PEEK) >= 0;
    }
    [[nodiscard]] Bytes receive() const {
        Bytes bytes(2000);
        const ssize_t n = ::recv(fd_, bytes.data(), bytes.size(), 0);
        bytes.resize(n < 0 ? 0 : static_cast<std::size_t>(n));
        return bytes;
    }

private:
    int fd_;
    bool bound_ = false;
};

Bytes counted_bytes(std::size_t size, int first) {
    Bytes bytes(size);
    std::iota(bytes.begin(), bytes.end(), static_cast<std::uint8_t>(first));
    return bytes;
}

std::unique_ptr<PacketSink> opened(const std::string& spec) {
    auto sink = open_packet_sink(spec, vlp16().network, false);
    EXPECT_TRUE(sink) << sink.error().text();
    return sink ? std::move(*sink) : nullptr;
}

TEST(UdpSink, DataAndPositionPacketsReachTheirPorts) {
    for (int port = 23'680; port < 23'980; ++port) {
        const Receiver data(port), position(port + kPositionPortOffset);
        if (!data.bound() || !position.bound()) continue;
        const auto sink = opened("udp:127.0.0.1:" + std::to_string(port));
        for (int i = 0; i < 20; ++i) {
            EXPECT_TRUE(sink->send(PacketKind::data, counted_bytes(1206, i), i));
            EXPECT_TRUE(sink->send(PacketKind::position, counted_bytes(512, i + 1), i));
            EXPECT_EQ(data.receive(), counted_bytes(1206, i));
            EXPECT_EQ(position.receive(), counted_bytes(512, i + 1));
        }
        EXPECT_EQ(sink->counters().sent, 40U);
        EXPECT_EQ(sink->counters().dropped, 0U);
        return;
    }
    GTEST_SKIP() << "no pair of free ports on loopback";
}

/// What the sink for this host says of itself where the system's table of names is `hosts`; empty: it has none, or
/// this user may not have a table of its own.
std::string description_where(const std::string& hosts, const std::string& host) {
    const test::TemporaryFolder folder;
    const std::string table = folder / "hosts", said = folder / "said";
    std::ofstream(table) << hosts;
    const pid_t child = ::fork();
    if (child == 0) {
        const bool own = ::unshare(::geteuid() == 0 ? CLONE_NEWNS : CLONE_NEWUSER | CLONE_NEWNS) == 0 &&
                         ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                         ::mount(table.c_str(), "/etc/hosts", nullptr, MS_BIND, nullptr) == 0;
        const auto sink = open_packet_sink("udp:" + host + ":2368", vlp16().network, false);
        if (own && sink) std::ofstream(said) << (*sink)->description();
        ::_exit(0);
    }
    ::waitpid(child, nullptr, 0);
    return test::read_text(said);
}

TEST(UdpSink, ANameWithAddressesOfBothFamiliesIsThatOfIpv4) {
    const std::string both = "::1 both.test\n127.0.0.7 both.test\n";
    if (description_where(both, "127.0.0.7").empty()) GTEST_SKIP() << "no file system of this user's own";
    EXPECT_EQ(description_where(both, "both.test"),
              "UDP to both.test (127.0.0.7), data port 2368, position port 8308");
    EXPECT_EQ(description_where(both, "127.0.0.7"), "UDP to 127.0.0.7, data port 2368, position port 8308");
    if (!open_packet_sink("udp:[::1]:2368", vlp16().network, false)) return;  // no IPv6 here
    EXPECT_EQ(description_where("::1 six.test\n", "six.test"),
              "UDP to six.test (::1), data port 2368, position port 8308");
}

/// A free port for packets of data and position on loopback.
int free_port() {
    for (int port = 24'000; port < 24'300; ++port)
        if (Receiver(port).bound() && Receiver(port + kPositionPortOffset).bound()) return port;
    return 0;
}

TEST(UdpSink, CountsWhatAReceiverOnThisMachineLoses) {
    const int port = free_port();
    if (port == 0) GTEST_SKIP() << "no pair of free ports on loopback";
    const auto send = [](PacketSink& sink, int packets) {
        for (int i = 0; i < packets; ++i) sink.send(PacketKind::data, counted_bytes(1206, i), i);
        sink.flush();
    };
    for (const std::string host : {"127.0.0.1", "127.0.0.2", "[::1]"}) {
        SCOPED_TRACE(host);
        const Receiver receiver(port);
        auto sink = open_packet_sink("udp:" + host + ":" + std::to_string(port), vlp16().network, false);
        if (!sink) continue;  // no such address family here
        send(**sink, 754);    // a second's
        const std::uint64_t lost = (*sink)->counters().receiver_dropped;
        if (host != "127.0.0.1") {
            EXPECT_EQ(lost, 0U) << "the receiver is at another address";
            continue;
        }
        std::uint64_t received = 0;
        while (receiver.waits()) received += !receiver.receive().empty();
        EXPECT_GT(lost, 0U) << "the default buffer holds 92 packets";
        EXPECT_EQ(received + lost, 754U);
        send(**sink, 5);
        EXPECT_EQ((*sink)->counters().receiver_dropped, lost) << "it has room again";

        const auto second = opened("udp:127.0.0.1:" + std::to_string(port));
        send(*second, 10);
        EXPECT_EQ(second->counters().receiver_dropped, 0U) << "losses of before are not its own";
    }
}

TEST(UdpSink, CountsWhatAReceiverThatCameLaterLoses) {
    const int port = free_port();
    if (port == 0) GTEST_SKIP() << "no pair of free ports on loopback";
    const auto sink = opened("udp:127.0.0.1:" + std::to_string(port));
    const Receiver receiver(port);
    for (int i = 0; i < 754; ++i) sink->send(PacketKind::data, counted_bytes(1206, i), i);
    // By itself, twice a second.
    for (int i = 0; i < 200 && sink->counters().receiver_dropped == 0; ++i) ::usleep(50'000);
    EXPECT_GT(sink->counters().receiver_dropped, 0U);
}

/// Each restart of a receiver is a new socket.
TEST(UdpSink, CountsWhatTheFiftiethReceiverLoses) {
    const int port = free_port();
    if (port == 0) GTEST_SKIP() << "no pair of free ports on loopback";
    const auto sink = opened("udp:127.0.0.1:" + std::to_string(port));
    for (int i = 0; i < 50; ++i) {
        const Receiver receiver(port);
        sink->flush();  // reads the counts
        if (i < 49) continue;
        for (int k = 0; k < 754; ++k) sink->send(PacketKind::data, counted_bytes(1206, k), k);
        sink->flush();
        EXPECT_GT(sink->counters().receiver_dropped, 0U);
    }
}

TEST(UdpSink, SendingWithoutReceiverIsNoError) {
    for (const std::string host : {"127.0.0.1", "localhost", "[::1]"}) {
        auto sink = open_packet_sink("udp:" + host + ":24999", vlp16().network, false);
        if (!sink) continue;  // no such address family here
        const Bytes packet = counted_bytes(1206, 0);
        for (int i = 0; i < 500; ++i) (*sink)->send(PacketKind::data, packet, 0);
        const PacketCounters c = (*sink)->counters();
        EXPECT_EQ(c.sent + c.dropped, 500U) << host;
        if (host == "127.0.0.1") {
            EXPECT_EQ(c.sent, 500U);
        }
    }
}

TEST(UdpSink, SendingAllocatesNothing) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has its own heap";
    const auto sink = opened("udp:127.0.0.1:24999");
    const Bytes packet = counted_bytes(1206, 0);
    const test::AllocationCounter counter;
    for (int i = 0; i < 1000; ++i) sink->send(PacketKind::data, packet, 0);
    EXPECT_EQ(counter.on_all_threads(), 0U);
}

/// A receiver among several of one port: of any address, or of the group that it joins on the loopback.
class SharedReceiver {
public:
    explicit SharedReceiver(int port, const char* group = nullptr) : fd_(::socket(AF_INET, SOCK_DGRAM, 0)) {
        const int on = 1;
        ::setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
        ::setsockopt(fd_, IPPROTO_IP, IP_RECVTTL, &on, sizeof on);
        const timeval patience{30, 0};
        ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_port = htons(static_cast<std::uint16_t>(port));
        ip_mreq membership{};
        if (group != nullptr) {
            ::inet_pton(AF_INET, group, &at.sin_addr);
            membership.imr_multiaddr = at.sin_addr;
            membership.imr_interface.s_addr = htonl(INADDR_LOOPBACK);
        }
        ready_ = ::bind(fd_, reinterpret_cast<sockaddr*>(&at), sizeof at) == 0 &&
                 (group == nullptr ||
                  ::setsockopt(fd_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) == 0);
    }
    ~SharedReceiver() { ::close(fd_); }
    SharedReceiver(const SharedReceiver&) = delete;
    SharedReceiver& operator=(const SharedReceiver&) = delete;

    [[nodiscard]] bool ready() const { return ready_; }
    struct Received {
        Bytes bytes;
        int ttl = -1;
    };
    [[nodiscard]] Received receive() const {
        Received r{Bytes(2000)};
        iovec part{r.bytes.data(), r.bytes.size()};
        alignas(cmsghdr) std::array<char, 64> control{};
        msghdr message{};
        message.msg_iov = &part;
        message.msg_iovlen = 1;
        message.msg_control = control.data();
        message.msg_controllen = control.size();
        const ssize_t n = ::recvmsg(fd_, &message, 0);
        r.bytes.resize(n < 0 ? 0 : static_cast<std::size_t>(n));
        if (const cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr && c->cmsg_type == IP_TTL)
            std::memcpy(&r.ttl, CMSG_DATA(c), sizeof r.ttl);
        return r;
    }

private:
    int fd_;
    bool ready_ = false;
};

/// As the instrument does by default, to 255.255.255.255; or to the addresses of one network, here the loopback's.
TEST(UdpSink, BroadcastsReachEveryReceiver) {
    const int port = free_port();
    if (port == 0) GTEST_SKIP() << "no pair of free ports on loopback";
    const SharedReceiver one(port), two(port), position(port + kPositionPortOffset);
    ASSERT_TRUE(one.ready() && two.ready() && position.ready());
    for (const std::string host : {"127.255.255.255", "255.255.255.255%lo"}) {
        SCOPED_TRACE(host);
        const auto sink = opened("udp:" + host + ":" + std::to_string(port));
        ASSERT_TRUE(sink);
        for (int i = 0; i < 20; ++i) {
            ASSERT_TRUE(sink->send(PacketKind::data, counted_bytes(1206, i), i));
            ASSERT_TRUE(sink->send(PacketKind::position, counted_bytes(512, i + 1), i));
            EXPECT_EQ(one.receive().bytes, counted_bytes(1206, i));
            EXPECT_EQ(two.receive().bytes, counted_bytes(1206, i));
            EXPECT_EQ(position.receive().bytes, counted_bytes(512, i + 1));
        }
        EXPECT_EQ(sink->counters().sent, 40U);
    }
}

TEST(UdpSink, AMulticastGroupsReceiversGetThePacketsAtTheTimeToLiveThatIsSet) {
    const int port = free_port();
    if (port == 0) GTEST_SKIP() << "no pair of free ports on loopback";
    const char* group = "239.255.23.68";
    const SharedReceiver one(port, group), two(port, group);
    if (!one.ready()) GTEST_SKIP() << "the loopback joins no multicast group here";
    for (const auto& [option, ttl] : {std::pair{"", 1}, {",ttl=7", 7}}) {
        const auto sink = opened("udp:" + std::string(group) + "%lo:" + std::to_string(port) + option);
        ASSERT_TRUE(sink);
        EXPECT_NE(sink->description().find("239.255.23.68 by lo"), std::string::npos) << sink->description();
        for (int i = 0; i < 20; ++i) {
            ASSERT_TRUE(sink->send(PacketKind::data, counted_bytes(1206, i), i));
            for (const SharedReceiver* r : {&one, &two}) {
                const auto received = r->receive();
                EXPECT_EQ(received.bytes, counted_bytes(1206, i));
                EXPECT_EQ(received.ttl, ttl);
            }
        }
    }
}

TEST(PacketSource, JoinsAMulticastGroup) {
    const int port = free_port();
    if (port == 0) GTEST_SKIP() << "no pair of free ports on loopback";
    const std::string at = "udp:239.255.23.69%lo:" + std::to_string(port);
    auto source = open_packet_source(at), second = open_packet_source(at);
    ASSERT_TRUE(source) << source.error().text();
    ASSERT_TRUE(second) << second.error().text();
    const auto sink = opened(at);
    ASSERT_TRUE(sink && sink->send(PacketKind::data, counted_bytes(1206, 3), 0));
    for (auto* s : {source->get(), second->get()}) {
        Bytes bytes(2000);
        bytes.resize(s->receive(bytes, 10'000'000'000));
        EXPECT_EQ(bytes, counted_bytes(1206, 3));
    }
}

TEST(PacketSink, NoneCounts) {
    const auto sink = opened("none");
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(sink->send(PacketKind::data, counted_bytes(1206, 0), 0));
    EXPECT_EQ(sink->counters().sent, 3U);
}

TEST(PacketSink, BadSinksSayWhatIsWrong) {
    const std::pair<const char*, const char*> cases[] = {
        {"", "expected udp:HOST:PORT, FILE.pcap, ouster:PORT, can, or none"},
        {"tcp:127.0.0.1:2368", "expected udp:HOST:PORT, FILE.pcap, ouster:PORT, can, or none"},
        {"udp:127.0.0.1", "expected udp:HOST:PORT, as in udp:127.0.0.1:2368"},
        {"udp::2368", "expected udp:HOST:PORT, as in udp:127.0.0.1:2368"},
        {"udp:127.0.0.1:", "expected a data port from 1 to 59595"},
        {"udp:127.0.0.1:0", "expected a data port from 1 to 59595"},
        {"udp:127.0.0.1:59596", "expected a data port from 1 to 59595"},
        {"udp:127.0.0.1:23x", "expected a data port from 1 to 59595"},
        {"udp:127.0.0.1:99999999999", "expected a data port from 1 to 59595"},
        {"udp:256.1.1.1:2368", "unknown host \"256.1.1.1\""},
        {"udp:239.1.2.3%:2368", "expected an interface after %, as in %eth0"},
        {"udp:239.1.2.3%lo:2368,ttl=256", "expected nothing after the port but ,ttl=N, from 0 to 255"},
        {"udp:239.1.2.3%lo:2368,hops=2", "expected nothing after the port but ,ttl=N, from 0 to 255"},
        {"udp:127.0.0.1:2368,ttl=0", "ttl=0"},
    };
    for (const auto& [spec, says] : cases) {
        const auto sink = open_packet_sink(spec, vlp16().network, false);
        ASSERT_FALSE(sink) << spec;
        EXPECT_EQ(sink.error().kind, ErrorKind::bad_input) << spec;
        EXPECT_NE(sink.error().text().find(says), std::string::npos) << sink.error().text();
    }
}

TEST(PacketSink, AnInterfaceThatIsNotThereIsMissing) {
    const auto sink = open_packet_sink("udp:239.1.2.3%none7:2368", vlp16().network, false);
    ASSERT_FALSE(sink);
    EXPECT_EQ(sink.error().kind, ErrorKind::missing);
    EXPECT_NE(sink.error().text().find("no network interface \"none7\""), std::string::npos) << sink.error().text();
    EXPECT_NE(sink.error().text().find("ip -br link"), std::string::npos) << sink.error().text();
}

}  // namespace
}  // namespace narpa
