// slcan lines, candump lines and python-can datagrams, each there and back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "protocols/can/candump.h"
#include "protocols/can/slcan.h"
#include "protocols/can/udp_multicast.h"
#include "tests/support/can_frames.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"

namespace narpa {
namespace {

CanFrame random_frame(std::mt19937_64& rng, bool may_be_fd) {
    CanFrame f;
    f.extended = rng() % 2 == 0;
    f.id = static_cast<std::uint32_t>(rng()) & (f.extended ? 0x1FFFFFFF : 0x7FF);
    f.fd = may_be_fd && rng() % 2 == 0;
    f.bit_rate_switch = f.fd && rng() % 2 == 0;
    f.remote = !f.fd && rng() % 4 == 0;
    f.size = static_cast<std::uint8_t>(rng() % (f.fd ? 65 : 9));
    if (!f.remote) std::generate_n(f.data.begin(), f.size, [&] { return static_cast<std::uint8_t>(rng()); });
    return f;
}

std::string slcan(const CanFrame& f) {
    std::array<char, kSlcanMaxLine> out;
    return {out.data(), encode_slcan(f, out)};
}

// The lines are those of the LAWICEL CANUSB manual's examples.
TEST(CanSlcan, KnownLines) {
    EXPECT_EQ(slcan(can_frame(0x100, {0x11, 0x22, 0x33})), "t1003112233\r");
    EXPECT_EQ(slcan(can_frame(0x100, {0x11, 0x22, 0x33}, true)), "T000001003112233\r");
    EXPECT_EQ(slcan(remote_frame(0x100, 3)), "r1003\r");
    EXPECT_EQ(slcan(remote_frame(0x100, 3, true)), "R000001003\r");
}

// The letters and lengths of CANable 2.
TEST(CanSlcan, KnownLinesOfCanFd) {
    const std::vector<std::uint8_t> data(12, 0xAB);
    const std::string digits = "ABABABABABABABABABABABAB\r";
    EXPECT_EQ(slcan(fd_frame(0x123, data, false)), "d1239" + digits);
    EXPECT_EQ(slcan(fd_frame(0x123, data, true)), "b1239" + digits);
    CanFrame f = fd_frame(0x1ABCDEF0, data, false);
    f.extended = true;
    EXPECT_EQ(slcan(f), "D1ABCDEF09" + digits);
    f.bit_rate_switch = true;
    EXPECT_EQ(slcan(f), "B1ABCDEF09" + digits);
    EXPECT_EQ(slcan(fd_frame(0x123, std::vector<std::uint8_t>(64, 0), true)).substr(0, 6), "b123F0");
}

TEST(CanSlcan, CarriesNothingOutOfRange) {
    CanFrame f = can_frame(0x123, {1});
    f.fd = f.remote = true;
    EXPECT_EQ(slcan(f), "");
    EXPECT_EQ(slcan(fd_frame(0x123, std::vector<std::uint8_t>(13, 0), true)), "") << "CAN FD has no 13 bytes";
    EXPECT_EQ(slcan(can_frame(0x800, {1})), "");
    EXPECT_EQ(slcan(can_frame(0x20000000, {1}, true)), "");
    f = can_frame(0x123, {1});
    f.size = 9;
    EXPECT_EQ(slcan(f), "");
}

TEST(CanSlcan, RoundTrip) {
    std::mt19937_64 rng(11);
    for (int i = 0; i < 20000; ++i) {
        CanFrame sent = random_frame(rng, true);
        if (sent.size > 8) sent.size = std::array<std::uint8_t, 7>{12, 16, 20, 24, 32, 48, 64}[rng() % 7];
        std::fill(sent.data.begin() + sent.size, sent.data.end(), std::uint8_t{0});
        const std::string line = slcan(sent);
        CanFrame out;
        ASSERT_TRUE(decode_slcan(std::string_view(line).substr(0, line.size() - 1), out)) << line;
        ASSERT_TRUE(same(sent, out)) << line;
    }
}

TEST(CanSlcan, RejectsBadLines) {
    CanFrame out = can_frame(0x7, {9});
    for (const char* line : {"",
                             "t",
                             "t1",
                             "t123",
                             "t1231",
                             "t12311",
                             "t1239112233445566778899",
                             "t123F",
                             "t80000",
                             "T200000000",
                             "T0000000",
                             "tXYZ0",
                             "t 120",
                             "t1230 ",
                             "t123011",
                             "r1239",
                             "x1230",
                             "t1232112",
                             "R0000000",
                             "t12311G",
                             "T1FFFFFFF",
                             "d123",
                             "d12390",
                             "b123900112233445566778899AABBC",
                             "D1230"})
        EXPECT_FALSE(decode_slcan(line, out)) << line;
    EXPECT_EQ(out.id, 0x7u) << "left as it was";
    EXPECT_TRUE(decode_slcan("t1231AB12EF", out)) << "a LAWICEL time stamp may follow";
    EXPECT_EQ(out.size, 1);
    EXPECT_TRUE(decode_slcan("t7ff2abCD", out)) << "either case";
    EXPECT_EQ(out.data[1], 0xCD);
}

std::vector<std::string> cut(SlcanLines& lines, std::string_view text, std::size_t step) {
    std::vector<std::string> found;
    for (std::size_t i = 0; i < text.size(); i += step) {
        std::span<const char> part(text.substr(i, step));
        while (lines.next(part)) found.emplace_back(lines.line());
    }
    return found;
}

TEST(CanSlcan, LinesComeWholeHoweverTheyArrive) {
    const std::string text = "C\rS6\r\r\nO\rt1001AA\r" + std::string(1000, 'x') + "\rt2000\r\aV\rhalf";
    for (std::size_t step = 1; step <= text.size(); ++step) {
        SlcanLines lines;
        EXPECT_EQ(cut(lines, text, step), (std::vector<std::string>{"C", "S6", "O", "t1001AA", "t2000", "V"}))
            << step;
        EXPECT_EQ(lines.overlong(), 1u);
        EXPECT_EQ(cut(lines, "way\r", 1), (std::vector<std::string>{"halfway"}));
    }
}

std::vector<std::uint8_t> datagram(const CanFrame& f) {
    std::array<std::uint8_t, kUdpMulticastMaxBytes> out;
    const std::size_t n = encode_udp_multicast(f, out);
    return {out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n)};
}

std::vector<std::uint8_t> datagram_bytes(std::string_view text) {
    return {text.begin(), text.end()};
}

/// What python-can 4.1 sends for 123#DEADBEEF, put together from the msgpack specification: 158 bytes.
TEST(CanUdpMulticast, SameBytesAsPythonCan) {
    using namespace std::string_view_literals;
    const std::string expected = std::string("\x8b\xa9timestamp\xcb\0\0\0\0\0\0\0\0"sv) +
                                 std::string(
                                     "\xae"
                                     "arbitration_id\xcd\x01\x23"sv) +
                                 "\xae"
                                 "is_extended_id\xc2" +
                                 "\xaf"
                                 "is_remote_frame\xc2" +
                                 "\xae"
                                 "is_error_frame\xc2" +
                                 "\xa7"
                                 "channel\xc0" +
                                 "\xa3"
                                 "dlc\x04" +
                                 "\xa4"
                                 "data\xc4\x04\xde\xad\xbe\xef" +
                                 "\xa5"
                                 "is_fd\xc2" +
                                 "\xae"
                                 "bitrate_switch\xc2" +
                                 "\xb5"
                                 "error_state_indicator\xc2";
    EXPECT_EQ(datagram(can_frame(0x123, {0xDE, 0xAD, 0xBE, 0xEF})), datagram_bytes(expected));
    EXPECT_EQ(expected.size(), 158u);
}

TEST(CanUdpMulticast, RoundTrip) {
    std::mt19937_64 rng(12);
    for (int i = 0; i < 20000; ++i) {
        const CanFrame sent = random_frame(rng, true);
        CanFrame out;
        ASSERT_TRUE(decode_udp_multicast(datagram(sent), out));
        ASSERT_TRUE(same(sent, out));
    }
}

TEST(CanUdpMulticast, MissingFlagsHavePythonCansDefaults) {
    CanFrame out;
    ASSERT_TRUE(decode_udp_multicast(datagram_bytes("\x82\xae"
                                                    "arbitration_id\x05\xa4"
                                                    "data\xc4\x01Z"),
                                     out));
    EXPECT_TRUE(out.extended);
    EXPECT_EQ(out.id, 5u);
    EXPECT_EQ(out.size, 1);
    EXPECT_EQ(out.data[0], 'Z');
}

TEST(CanUdpMulticast, RejectsBadMaps) {
    const std::vector<std::uint8_t> good = datagram(can_frame(0x123, {1, 2, 3}));
    CanFrame out;
    ASSERT_TRUE(decode_udp_multicast(good, out));
    for (std::size_t n = 0; n < good.size(); ++n)
        EXPECT_FALSE(decode_udp_multicast(std::span(good).first(n), out)) << n << " bytes of it";
    std::vector<std::uint8_t> bad = good;
    bad.push_back(0xC0);
    EXPECT_FALSE(decode_udp_multicast(bad, out)) << "trailing byte";
    bad = good;
    bad[2] = 'x';
    EXPECT_FALSE(decode_udp_multicast(bad, out)) << "unknown key";
    using namespace std::string_view_literals;
    for (const std::string_view text : {"junk"sv, "\x80"sv,
                                        "\x81\xa4"
                                        "data\xc4\x00"sv,
                                        "\xdf\xff\xff\xff\xff"sv, "\x8f"sv,
                                        "\x82\xae"
                                        "arbitration_id\x05\xae"
                                        "arbitration_id\x05"sv,  // twice
                                        "\x82\xae"
                                        "arbitration_id\x05\xa4"
                                        "data\xa1Z"sv,  // str
                                        "\x82\xae"
                                        "arbitration_id\x05\xa4"
                                        "data\xc6\xff\xff\xff\xffZ"sv,  // 4 GiB
                                        "\x83\xae"
                                        "arbitration_id\x05\xa4"
                                        "data\xc4\x01Z\xa3"
                                        "dlc\x02"sv,  // dlc
                                        "\x82\xae"
                                        "arbitration_id\xcd\x08\x00\xae"
                                        "is_extended_id\xc2"sv,  // 0x800
                                        "\x81\xae"
                                        "arbitration_id\xce\x20\x00\x00\x00"sv,
                                        "\x81\xae"
                                        "arbitration_id\xff"sv,  // range
                                        "\x82\xae"
                                        "arbitration_id\x05\xa4"
                                        "data\xc4\x09"
                                        "123456789"sv,  // 9 bytes
                                        "\x83\xae"
                                        "arbitration_id\x05\xa5"
                                        "is_fd\xc3\xaf"
                                        "is_remote_frame\xc3"sv})
        EXPECT_FALSE(decode_udp_multicast(datagram_bytes(text), out));
}

std::string candump(const CandumpLine& line) {
    std::array<char, kCandumpMaxLine> out;
    return {out.data(), format_candump(line, "vcan0", out)};
}

TEST(CanCandump, KnownLines) {
    CandumpLine line{1'700'000'000'250'000'000, can_frame(0x123, {0xDE, 0xAD, 0xBE, 0xEF})};
    EXPECT_EQ(candump(line), "(1700000000.250000) vcan0 123#DEADBEEF\n");
    line.frame.extended = true;
    EXPECT_EQ(candump(line), "(1700000000.250000) vcan0 00000123#DEADBEEF\n");
    line.frame.fd = line.frame.bit_rate_switch = true;
    EXPECT_EQ(candump(line), "(1700000000.250000) vcan0 00000123##1DEADBEEF\n");
    line = {500'000, remote_frame(0x7FF, 4)};
    EXPECT_EQ(candump(line), "(0000000000.000500) vcan0 7FF#R4\n");
    line.frame.size = 0;
    EXPECT_EQ(candump(line), "(0000000000.000500) vcan0 7FF#R\n");
}

TEST(CanCandump, HasNoStampBeforeZero) {
    std::array<char, kCandumpMaxLine> out;
    const std::size_t n = format_candump({-49'939'000, can_frame(0x123, {1})}, "narpa", out);
    EXPECT_EQ(std::string(out.data(), n), "(0000000000.000000) narpa 123#01\n");
}

TEST(CanCandump, StatesHowManyFramesAreNotInTheLogAsTheReadmeShows) {
    std::array<char, kCandumpMaxLine> out;
    const std::size_t n = format_candump({12'100'000'000, lost_frames(77'411)}, "not_logged", out);
    const std::string line(out.data(), n);
    EXPECT_EQ(line, "(0000000012.100000) not_logged 20000004#00010000632E0100\n");
    EXPECT_NE(test::read_text(test::source_path("protocols/can/README.md")).find(line), std::string::npos);
}

TEST(CanCandump, ReadsWhatOthersWrite) {
    CandumpLine line;
    ASSERT_EQ(parse_candump("(1700000000.250000) vcan0 123#DEADBEEF R", line), nullptr) << "python-can";
    EXPECT_EQ(line.t_ns, 1'700'000'000'250'000'000);
    EXPECT_EQ(line.frame.size, 4);
    ASSERT_EQ(parse_candump(" (1.5)  can0  18FF50E5##3001122 \r", line), nullptr);
    EXPECT_EQ(line.t_ns, 1'500'000'000);
    EXPECT_TRUE(line.frame.fd && line.frame.extended && line.frame.bit_rate_switch);
    EXPECT_EQ(line.frame.size, 3);
    ASSERT_EQ(parse_candump("(0.123456789) can0 001#", line), nullptr);
    EXPECT_EQ(line.t_ns, 123'456'789);
    EXPECT_EQ(line.frame.size, 0);
    ASSERT_EQ(parse_candump("(7) can0 001#r8 T", line), nullptr);
    EXPECT_TRUE(line.frame.remote);
    EXPECT_EQ(line.frame.size, 8);
    ASSERT_EQ(parse_candump("(7) can0 001#r8_F", line), nullptr) << "a length code";
    EXPECT_EQ(line.frame.size, 8);
    ASSERT_EQ(parse_candump("(7) can0 001#1122334455667788_9", line), nullptr) << "a length code";
    EXPECT_EQ(line.frame.size, 8);
    EXPECT_EQ(line.interface, "can0");
    for (const char* wrong : {"(7) can0 001#1122_9", "(7) can0 001#R4_9", "(7) can0 001#1122334455667788_8",
                              "(7) can0 001#1122334455667788_99", "(7) can0 45123#81:00:1234567#11"})
        EXPECT_NE(parse_candump(wrong, line), nullptr) << wrong;
    ASSERT_EQ(parse_candump("(7) can0 45123#81:00:12345678#11223344", line), nullptr) << "CAN XL";
    EXPECT_TRUE(line.is_xl);
    ASSERT_EQ(parse_candump("(7) can0 001#11.22.33", line), nullptr) << "cansend's dots";
    EXPECT_FALSE(line.is_xl);
    EXPECT_EQ(line.frame.data[2], 0x33);
    ASSERT_EQ(parse_candump("(7) can0 20000040#0000000000000000", line), nullptr) << "error report";
    EXPECT_TRUE(line.frame.error);
}

TEST(CanCandump, RoundTrip) {
    std::mt19937_64 rng(13);
    for (int i = 0; i < 20000; ++i) {
        const CandumpLine sent{static_cast<std::int64_t>(rng() % 2'000'000'000'000'000) * 1000,
                               random_frame(rng, true)};
        const std::string text = candump(sent);
        CandumpLine out;
        ASSERT_EQ(parse_candump(std::string_view(text).substr(0, text.size() - 1), out), nullptr) << text;
        ASSERT_EQ(out.t_ns, sent.t_ns);
        ASSERT_TRUE(same(out.frame, sent.frame)) << text;
    }
}

TEST(CanCandump, ErrorsNameWhatWasExpected) {
    CandumpLine line;
    const auto complaint = [&](std::string_view text) {
        const char* expected = parse_candump(text, line);
        return std::string(expected == nullptr ? "" : expected);
    };
    EXPECT_EQ(complaint(""), "expected a stamp such as (1700000000.250000)");
    EXPECT_EQ(complaint("(1.2.3) vcan0 123#"), "expected a stamp such as (1700000000.250000)");
    EXPECT_EQ(complaint("(99999999999) vcan0 123#"), "expected a stamp such as (1700000000.250000)");
    EXPECT_EQ(complaint("(1)"), "expected an interface name such as vcan0");
    EXPECT_EQ(complaint("(1) vcan0"), "expected a frame such as 123#DEADBEEF");
    EXPECT_EQ(complaint("(1) vcan0 1234#"), "expected an identifier of 3 or 8 hex digits");
    EXPECT_EQ(complaint("(1) vcan0 800#"), "expected an identifier up to 7FF (3 digits) or 1FFFFFFF (8 digits)");
    EXPECT_EQ(complaint("(1) vcan0 123#0"), "expected pairs of hex digits as data");
    EXPECT_EQ(complaint("(1) vcan0 123#001122334455667788"), "expected at most 8 bytes of data");
    EXPECT_EQ(complaint("(1) vcan0 123##" + std::string(1, '0') + std::string(130, 'A')),
              "expected at most 64 bytes of data");
    EXPECT_EQ(complaint("(1) vcan0 123##"), "expected one hex digit of flags after ##");
    EXPECT_EQ(complaint("(1) vcan0 123#R9"), "expected a length of 0 to 8 after R");
    EXPECT_EQ(complaint("(1) vcan0 123#00 R R"), "expected nothing, R or T after the frame");
}

}  // namespace
}  // namespace narpa
