#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>

#include "protocols/lidar/position.h"

namespace narpa::vlp16 {
namespace {

using Bytes = std::array<std::uint8_t, kPositionPacketBytes>;

Bytes encoded(std::int64_t unix_ns) {
    Bytes bytes;
    bytes.fill(0xAA);
    encode_position(unix_ns, bytes);
    return bytes;
}

std::string sentence(const Bytes& b) {
    return {b.begin() + 206, std::find(b.begin() + 206, b.end(), std::uint8_t{0})};
}

Bytes with_sentence(const std::string& text) {
    Bytes b = encoded(0);
    std::fill(b.begin() + 206, b.end(), std::uint8_t{0});
    std::copy(text.begin(), text.end(), b.begin() + 206);
    return b;
}

// Manual 63-9243 Rev. D, table 9-3 (its offsets less the 42 bytes of header) and table 9-4.
TEST(Vlp16Position, PacketHasTheManualsBytes) {
    static_assert(kPositionPacketBytes + 42 == 554);
    const Bytes b = encoded(1'709'210'096'789'012'345);  // 2024-02-29T12:34:56.789012345Z
    EXPECT_TRUE(std::all_of(b.begin(), b.begin() + 198, [](auto x) { return x == 0; }));
    const std::array<std::uint8_t, 8> middle{0x14, 0x76, 0xFA, 0x7C, 2, 0, 0, 0};  // 2096789012 us, PPS locked
    EXPECT_TRUE(std::equal(middle.begin(), middle.end(), b.begin() + 198));
    const std::string text = sentence(b);
    EXPECT_EQ(text, "$GPRMC,123456,A,0000.0000,N,00000.0000,E,000.0,000.0,290224,000.0,E*7E\r\n");
    EXPECT_TRUE(
        std::all_of(b.begin() + 206 + static_cast<long>(text.size()), b.end(), [](auto x) { return x == 0; }));
}

TEST(Vlp16Position, DecodeUndoesEncode) {
    std::mt19937_64 random(42);
    constexpr std::int64_t end_of_2069 = 3'155'759'999;
    for (int trial = 0; trial < 2000; ++trial) {
        const auto s = static_cast<std::int64_t>(random() % (end_of_2069 + 1));
        const auto ns = static_cast<std::int64_t>(random() % 1'000'000'000);
        const auto packet = decode_position(encoded(s * 1'000'000'000 + ns));
        ASSERT_TRUE(packet) << s;
        EXPECT_EQ(packet->unix_s, s);
        EXPECT_EQ(packet->past_hour_us, static_cast<std::uint64_t>(s % 3600) * 1'000'000 + ns / 1000);
        EXPECT_EQ(packet->pps, PpsState::locked);
    }
}

// Example sentences of receivers, from the NMEA 0183 literature; the second has decimals and a mode letter.
TEST(Vlp16Position, ReadsOtherReceiversSentences) {
    const auto a =
        decode_position(with_sentence("$GPRMC,081836,A,3751.65,S,14507.36,E,000.0,360.0,130998,011.3,E*62\r\n"));
    ASSERT_TRUE(a);
    EXPECT_EQ(a->unix_s, 905'674'716);  // 1998-09-13T08:18:36Z
    const auto b =
        decode_position(with_sentence("$GPRMC,225446.00,A,4916.45,N,12311.12,W,000.5,054.7,191194,,,A*41\r\n"));
    ASSERT_TRUE(b);
    EXPECT_EQ(b->unix_s, 785'285'686);  // 1994-11-19T22:54:46Z
}

TEST(Vlp16Position, RefusesWhatIsNotOne) {
    const Bytes good = encoded(1'700'000'000'000'000'000);
    ASSERT_TRUE(decode_position(good));
    EXPECT_FALSE(decode_position({}));
    EXPECT_FALSE(decode_position(std::span(good).first(511)));
    for (std::size_t i = 206; i < 206 + sentence(good).size(); ++i) {
        Bytes bad = good;
        bad[i] ^= 1;
        EXPECT_FALSE(decode_position(bad)) << "byte " << i;
    }
    Bytes bad = good;
    bad[202] = 4;  // PPS state
    EXPECT_FALSE(decode_position(bad));
    bad = good;
    bad[201] = 0xFF;  // time stamp beyond the hour
    EXPECT_FALSE(decode_position(bad));
    EXPECT_FALSE(decode_position(with_sentence("")));
    EXPECT_FALSE(decode_position(with_sentence("$GPRMC,*4B\r\n")));
    EXPECT_FALSE(decode_position(with_sentence("$GPRMC,081836,A")));
}

}  // namespace
}  // namespace narpa::vlp16
