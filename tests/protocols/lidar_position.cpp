#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <random>
#include <string>

#include "protocols/lidar/velodyne.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

using PositionBytes = std::array<std::uint8_t, 512>;

PositionBytes encoded(std::int64_t unix_ns) {
    PositionBytes bytes;
    bytes.fill(0xAA);  // everything must be overwritten
    vlp16().configure_default()->encode_position(unix_ns, bytes);
    return bytes;
}

std::string sentence(const PositionBytes& b) {
    return {b.begin() + 206, std::find(b.begin() + 206, b.end(), std::uint8_t{0})};
}

// Manual 63-9243 Rev. D, table 9-3 (its offsets less the 42 bytes of header) and table 9-4.
TEST(Vlp16Position, PacketHasTheManualsBytes) {
    ASSERT_EQ(vlp16().configure_default()->spec().position_packet_bytes + 42, 554U);
    const PositionBytes b = encoded(1'709'210'096'789'012'345);  // 2024-02-29T12:34:56.789012345Z
    EXPECT_TRUE(std::all_of(b.begin(), b.begin() + 198, [](auto x) { return x == 0; }));
    const std::array<std::uint8_t, 8> middle{0x14, 0x76, 0xFA, 0x7C, 2, 0, 0, 0};  // 2096789012 us, PPS locked
    EXPECT_TRUE(std::equal(middle.begin(), middle.end(), b.begin() + 198));
    const std::string text = sentence(b);
    EXPECT_EQ(text, "$GPRMC,123456,A,0000.0000,N,00000.0000,E,000.0,000.0,290224,000.0,E*7E\r\n");
    EXPECT_TRUE(
        std::all_of(b.begin() + 206 + static_cast<long>(text.size()), b.end(), [](auto x) { return x == 0; }));
}

// NMEA 0183: the checksum is the exclusive or of the characters between `$` and `*`.
TEST(Vlp16Position, AnyInstantIsWrittenWithItsTimeDateAndChecksum) {
    std::mt19937_64 random(42);
    constexpr std::int64_t end_of_2069 = 3'155'759'999;
    for (int trial = 0; trial < 2000; ++trial) {
        const auto s = static_cast<std::int64_t>(random() % (end_of_2069 + 1));
        const auto ns = static_cast<std::int64_t>(random() % 1'000'000'000);
        const PositionBytes b = encoded(s * 1'000'000'000 + ns);
        EXPECT_EQ(get_le<std::uint32_t>(&b[198]), static_cast<std::uint64_t>(s % 3600) * 1'000'000 + ns / 1000);
        const std::time_t time = s;
        std::tm utc{};
        ::gmtime_r(&time, &utc);
        std::array<char, 128> expected{};
        const std::size_t n =
            std::strftime(expected.data(), expected.size(),
                          "GPRMC,%H%M%S,A,0000.0000,N,00000.0000,E,000.0,000.0,%d%m%y,000.0,E", &utc);
        unsigned sum = 0;
        for (std::size_t i = 0; i < n; ++i) sum ^= static_cast<unsigned char>(expected[i]);
        std::array<char, 8> tail{};
        std::snprintf(tail.data(), tail.size(), "*%02X\r\n", sum);
        ASSERT_EQ(sentence(b), "$" + std::string(expected.data(), n) + tail.data()) << s;
    }
}

// Table 9-3: 0 none, 1 synchronising, 2 locked, 3 error. The sentence is valid (A) while the time is.
TEST(Vlp16Position, StatesThePulsePerSecond) {
    for (const auto pps : {LidarPps::absent, LidarPps::synchronising, LidarPps::locked, LidarPps::error}) {
        PositionBytes b;
        vlp16().configure({.rate_hz = 10, .pps = pps})->encode_position(1'709'210'096'789'012'345, b);
        EXPECT_EQ(b[202], static_cast<int>(pps));
        EXPECT_EQ(sentence(b).substr(13, 3), pps == LidarPps::locked ? ",A," : ",V,");
        unsigned sum = 0;
        const std::string text = sentence(b);
        for (std::size_t i = 1; text[i] != '*'; ++i) sum ^= static_cast<unsigned char>(text[i]);
        EXPECT_EQ(std::stoul(text.substr(text.find('*') + 1, 2), nullptr, 16), sum);
    }
}

}  // namespace
}  // namespace narpa
