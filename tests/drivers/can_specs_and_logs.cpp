// Which bus a BUS text names, what is said when it cannot be had, and candump logs as a bus.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>

#include "drivers/descriptor.h"
#include "protocols/can/udp_multicast.h"
#include "tests/drivers/can_support.h"
#include "tests/support/campaign.h"

namespace narpa {
namespace {

Error error_of(const std::string& spec, CanRole role = CanRole::hub) {
    auto bus = open_can_bus(spec, role);
    EXPECT_FALSE(bus) << spec;
    return bus ? Error{} : bus.error();
}

TEST(MemoryBus, AHubNeedsAClientOfItsName) {
    const auto alone = open_can_bus("memory:specs", CanRole::hub);
    ASSERT_FALSE(alone);
    EXPECT_NE(alone.error().what.find("within this process"), std::string::npos) << alone.error().what;
    const auto client = open_can_bus("memory:specs", CanRole::client);
    ASSERT_TRUE(client);
    EXPECT_FALSE(open_can_bus("memory:specs", CanRole::client)) << "the name is taken";
    EXPECT_TRUE(open_can_bus("memory:specs", CanRole::hub));
    EXPECT_FALSE(open_can_bus("memory:specs", CanRole::hub)) << "it has a hub";
}

TEST(CanSpec, BadTextsAreBadInput) {
    for (const char* spec :
         {"", "usb:x/300", "usb:@5", "usb:@500000,100000", "usb:a b", "vcan:0", "slcan:", "slcan:70000", "slcan:-1",
          "slcan:1x", "slcan:tcp", "udp:", "udp:10.0.0.1", "udp:239.1", "log:", "a/b", "a-name-far-too-long"}) {
        const Error e = error_of(spec);
        EXPECT_EQ(e.kind, ErrorKind::bad_input) << spec;
        EXPECT_NE(e.what.find("expected"), std::string::npos) << e.what;
    }
    EXPECT_NE(error_of("slcan:0", CanRole::client).what.find("1 to 65535"), std::string::npos);
}

TEST(CanSpec, MissingThingsComeWithARemedy) {
    const Error can = error_of("vcan77");
    EXPECT_EQ(can.kind, ErrorKind::missing);
    EXPECT_FALSE(can.remedy.empty()) << can.what;

    auto hub = open_or_fail("slcan:0", CanRole::hub);
    const std::string spec = "slcan:" + std::to_string(hub_port(*hub));
    const Error taken = error_of(spec);
    EXPECT_EQ(taken.kind, ErrorKind::missing);
    EXPECT_NE(taken.what.find("Address already in use"), std::string::npos) << taken.what;
    hub.reset();
    const Error alone = error_of(spec, CanRole::client);
    EXPECT_EQ(alone.kind, ErrorKind::missing);
    EXPECT_NE(alone.what.find("refused"), std::string::npos) << alone.what;
    EXPECT_NE(alone.remedy.find("narpa run"), std::string::npos);
}

class CanLog : public testing::Test {
protected:
    std::string write(const std::string& text) {
        std::ofstream(path_) << text;
        return "log:" + path_;
    }
    void TearDown() override { std::filesystem::remove(path_); }
    const std::string path_ = testing::TempDir() + "narpa_can_" + std::to_string(::getpid()) + ".log";
};

TEST_F(CanLog, GivesAllFramesAtOnceWithTheirTimes) {
    auto bus =
        open_or_fail(write("(1700000000.250000) vcan0 123#DEADBEEF R\n\n(1700000000.250500) vcan0 18FF50E5##1AA\r\n"
                           "(1700000001.000000) vcan0 20000040#0000000000000000\n(1700000003.250000) vcan0 7FF#R2"),
                     CanRole::hub);
    ASSERT_TRUE(bus);
    EXPECT_TRUE(bus->recorded());
    EXPECT_EQ(bus->counters().error_frames, 1u);
    ReceivedFrame out;
    bus->wait(-1);
    ASSERT_TRUE(bus->receive(out));
    EXPECT_EQ(out.t_received_ns, 0);
    EXPECT_TRUE(same(out.frame, can_frame(0x123, {0xDE, 0xAD, 0xBE, 0xEF})));
    ASSERT_TRUE(bus->receive(out));
    EXPECT_EQ(out.t_received_ns, 500'000);
    EXPECT_TRUE(out.frame.fd && out.frame.extended);
    EXPECT_FALSE(bus->ended());
    ASSERT_TRUE(bus->receive(out));
    EXPECT_EQ(out.t_received_ns, 3'000'000'000);
    EXPECT_TRUE(bus->ended());
    EXPECT_FALSE(bus->receive(out));
    EXPECT_FALSE(bus->send(can_frame(1, {})));
    bus->wait(-1);
}

TEST_F(CanLog, BadLineIsNamed) {
    const Error e = error_of(write("(1.0) vcan0 123#00\n(2.0) vcan0 123#0\n"));
    EXPECT_EQ(e.text(), path_ + ":2: expected pairs of hex digits as data");
    EXPECT_EQ(e.kind, ErrorKind::bad_input);
    EXPECT_EQ(error_of("log:/no/such/file.log").text(),
              "/no/such/file.log: cannot open the CAN log: No such file or directory");
    EXPECT_EQ(error_of("log:/no/such/file.log", CanRole::client).kind, ErrorKind::bad_input);
}

TEST_F(CanLog, ByteOrderMarkAndLineEndsOfOtherSystemsAreRead) {
    std::string utf16("\xff\xfe", 2);
    for (const char c : std::string("(1.0) vcan0 123#00\r\n(2.0) vcan0 123#01\r\n")) utf16 += c, utf16 += '\0';
    for (const std::string& text : {std::string("\xef\xbb\xbf(1.0) vcan0 123#00\n(2.0) vcan0 123#01\n"),
                                    std::string("\xef\xbb\xbf(1.0) vcan0 123#00\r\n(2.0) vcan0 123#01\r\n"),
                                    std::string("(1.0) vcan0 123#00\r(2.0) vcan0 123#01\r"), utf16}) {
        auto bus = open_or_fail(write(text), CanRole::hub);
        ASSERT_TRUE(bus);
        ReceivedFrame out;
        ASSERT_TRUE(bus->receive(out));
        ASSERT_TRUE(bus->receive(out));
        EXPECT_TRUE(same(out.frame, can_frame(0x123, {1})));
        EXPECT_TRUE(bus->ended());
    }
    EXPECT_EQ(error_of(write("\xef\xbb\xbf(1.0) vcan0 123#00\r(2.0) vcan0 123#0\r")).line, 2);
}

TEST_F(CanLog, AnInterfaceIsChosenWhereThereAreSeveral) {
    const std::string text =
        "(1.0) can0 100#01\n(1.1) can1 100#02\n(1.2) can0 45123#81:00:12345678#1122\n(1.3) can0 100#03\n";
    const Error e = error_of(write(text));
    EXPECT_EQ(e.text(), path_ + ":2: frames of can1 after those of can0, expected those of one bus: log:" + path_ +
                            ":can0 or log:" + path_ + ":can1");
    auto bus = open_or_fail(write(text) + ":can0", CanRole::hub);
    ASSERT_TRUE(bus);
    EXPECT_EQ(bus->description(), "log: " + path_ + " (2 frames of can0)");
    EXPECT_EQ(bus->counters().not_carried, 1u);
    ReceivedFrame out;
    ASSERT_TRUE(bus->receive(out) && bus->receive(out));
    EXPECT_TRUE(same(out.frame, can_frame(0x100, {3})));
    EXPECT_EQ(error_of(write(text) + ":can2").text(), path_ + ": it has no frame of can2, but of can0");
}

TEST_F(CanLog, ALastLineThatIsCutOffIsLeftOut) {
    auto bus = open_or_fail(write("(1.0) can0 100#01\n(1.1) can0 100#02\n(1.2) can0 100#0"), CanRole::hub);
    ASSERT_TRUE(bus);
    EXPECT_EQ(bus->description(), "log: " + path_ + " (2 frames; its last line is cut off and left out)");
    EXPECT_EQ(bus->counters().malformed, 1u);
    EXPECT_EQ(error_of(write("(1.0) can0 100#01\n(1.1) can0 100#0\n")).line, 2);
}

TEST_F(CanLog, LogsOfOtherProgramsAreNamed) {
    const std::pair<const char*, const char*> logs[]{
        {"date Sat Nov 28 01:02:39.451 PM 2026\nbase hex  timestamps absolute\n", "asc2log -I FILE -O OUT.log"},
        {"timestamp,arbitration_id,extended,remote,error,dlc,data\n1.0,0x100,0,0,0,1,AQ==\n", "can.logconvert"},
        {";$FILEVERSION=1.1\n", "can.logconvert"},
        {"LOGG\1\2\3", "can.logconvert"},
        {"  vcan0  100   [8]  00 00 00 00 00 00 00 23\n", "candump -l and -L write what is needed"},
        {" (1700000000.000000)  vcan0  100   [2]  00 23\n", "candump -l and -L write what is needed"},
        {"not a log\n", "expected a stamp"}};
    for (const auto& [text, what] : logs)
        EXPECT_NE(error_of(write(text)).what.find(what), std::string::npos) << text;
}

/// A random log, and what follows from its lines.
class RandomLog {
public:
    explicit RandomLog(unsigned seed) : random_(seed) {
        chosen = whole(0, 1) == 0;
        const char* const line_end = std::array{"\n", "\r\n", "\r"}[index(2)];
        if (whole(0, 3) == 0) text = "\xEF\xBB\xBF";
        const int lines = whole(1, 30);
        for (int i = 0; i < lines; ++i) {
            const bool mine = i == 0 || !chosen || whole(0, 2) != 0;
            text += "(" + std::to_string(100 + i) + ".5) " + (mine ? "can0 " : "can1 ") + line(mine) +
                    std::array{"", " R", " T"}[index(2)] + (i + 1 < lines || whole(0, 1) != 0 ? line_end : "");
        }
    }
    std::string text;
    bool chosen = false;  ///< only the lines of can0 count
    std::vector<CanFrame> frames;
    std::uint64_t errors = 0, not_carried = 0;

private:
    int whole(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }
    std::size_t index(int last) { return static_cast<std::size_t>(whole(0, last)); }

    std::string line(bool mine) {
        const int form = whole(0, 6);
        if (form == 2) return errors += mine, "20000040#0000000000000000";
        if (form == 3) return not_carried += mine, "45123#81:00:12345678#11223344";
        const bool extended = whole(0, 1) != 0;
        const auto id = static_cast<std::uint32_t>(whole(0, extended ? 0x1FFFFFFF : 0x7FF));
        std::array<char, 16> name{};
        std::snprintf(name.data(), name.size(), extended ? "%08X" : "%03X", id);
        std::vector<std::uint8_t> data;
        std::string hex;
        for (int n = whole(0, 8); n > 0; --n) {
            data.push_back(static_cast<std::uint8_t>(whole(0, 255)));
            std::array<char, 4> digits{};
            std::snprintf(digits.data(), digits.size(), whole(0, 1) != 0 ? "%02X" : "%02x", data.back());
            hex += (!hex.empty() && whole(0, 9) == 0 ? "." : "") + std::string(digits.data());
        }
        CanFrame frame = can_frame(id, data, extended);
        std::string content = "#" + hex + (data.size() == 8 && whole(0, 1) != 0 ? "_E" : "");
        if (form == 0) {
            const auto size = static_cast<std::uint8_t>(data.size());
            frame = remote_frame(id, size, extended);
            content = "#R" + std::to_string(size) + (size == 8 && whole(0, 1) != 0 ? "_C" : "");
        } else if (form == 1) {
            frame = fd_frame(id, data, true);
            frame.extended = extended;
            content = std::string("##") + (whole(0, 1) != 0 ? "1" : "5") + hex;
        }
        if (mine) frames.push_back(frame);
        return name.data() + content;
    }
    std::mt19937_64 random_;
};

TEST_F(CanLog, FramesFollowFromRandomLines) {
    for (unsigned seed = 0; seed < static_cast<unsigned>(test::trials(200, 10'000)) && !HasFailure(); ++seed) {
        const RandomLog log(seed);
        auto bus = open_or_fail(write(log.text) + (log.chosen ? ":can0" : ""), CanRole::hub);
        ASSERT_TRUE(bus) << log.text;
        EXPECT_EQ(bus->counters().error_frames, log.errors) << log.text;
        EXPECT_EQ(bus->counters().not_carried, log.not_carried) << log.text;
        ReceivedFrame out;
        for (const CanFrame& f : log.frames) {
            ASSERT_TRUE(bus->receive(out)) << log.text;
            EXPECT_TRUE(same(out.frame, f)) << std::hex << f.id << "\n" << log.text;
        }
        EXPECT_FALSE(bus->receive(out)) << log.text;
    }
}

TEST_F(CanLog, EmptyLogHasEndedAtOnce) {
    auto bus = open_or_fail(write(""), CanRole::hub);
    ASSERT_TRUE(bus);
    EXPECT_TRUE(bus->ended());
}

TEST_F(CanLog, WhatAClientWritesAHubReads) {
    std::vector<CanFrame> frames{
        can_frame(0x123, {1, 2, 3}),   can_frame(0x123, {1, 2, 3}, true),
        remote_frame(0x7FF, 4),        remote_frame(0x1FFFFFFF, 0, true),
        fd_frame(0x10F, {1, 2}, true), fd_frame(0x10F, std::vector<std::uint8_t>(64, 7), false)};
    for (std::uint32_t i = 0; i < 3000; ++i) frames.push_back(can_frame(i % 0x800, {static_cast<std::uint8_t>(i)}));
    {
        auto writer = open_or_fail("log:" + path_, CanRole::client);
        ASSERT_TRUE(writer);
        for (const CanFrame& f : frames) ASSERT_TRUE(writer->send(f));
        EXPECT_FALSE(writer->send(can_frame(0x800, {})));
        EXPECT_EQ(writer->counters().sent, frames.size());
        EXPECT_EQ(writer->counters().send_drops, 1u);
    }
    auto reader = open_or_fail("log:" + path_, CanRole::hub);
    ASSERT_TRUE(reader);
    ReceivedFrame out;
    std::int64_t t_last_ns = 0;
    for (const CanFrame& f : frames) {
        ASSERT_TRUE(reader->receive(out));
        ASSERT_TRUE(same(out.frame, f)) << std::hex << f.id;
        ASSERT_GE(out.t_received_ns, t_last_ns);
        t_last_ns = out.t_received_ns;
    }
    EXPECT_TRUE(reader->ended());
}

TEST(CanUdp, JunkIsCountedAndOtherGroupsAreOtherBuses) {
    const std::string group = own_group();
    auto bus = open_or_fail("udp:" + group, CanRole::hub);
    auto other = open_or_fail("udp:239.74.163.250", CanRole::client);
    auto peer = open_or_fail("udp:" + group, CanRole::client);
    ASSERT_TRUE(bus && other && peer);
    ASSERT_TRUE(other->send(can_frame(0x7, {1})));

    const Descriptor fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    in_addr loopback{};
    loopback.s_addr = htonl(INADDR_LOOPBACK);
    ASSERT_EQ(::setsockopt(fd.get(), IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof loopback), 0);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(kUdpMulticastPort);
    ::inet_pton(AF_INET, group.c_str(), &to.sin_addr);
    std::array<std::uint8_t, kUdpMulticastMaxBytes> good;
    const std::size_t n = encode_udp_multicast(can_frame(0x9, {1}), good);
    const std::vector<std::string> junk{"", "x", std::string(4000, '\x8b'),
                                        std::string(good.begin(), good.begin() + 30)};
    for (int i = 0; i < 200; ++i)
        for (const std::string& text : junk)
            ::sendto(fd.get(), text.data(), text.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    ASSERT_EQ(::sendto(fd.get(), good.data(), n, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to),
              static_cast<ssize_t>(n));
    ReceivedFrame out;
    ASSERT_TRUE(next_frame(*bus, out));
    EXPECT_EQ(out.frame.id, 0x9u);
    EXPECT_EQ(bus->counters().malformed, 800u);
    ASSERT_TRUE(peer->send(can_frame(0x8, {1})));
    ASSERT_TRUE(next_frame(*bus, out));
    EXPECT_EQ(out.frame.id, 0x8u);
}

}  // namespace
}  // namespace narpa
