#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "protocols/video/embedded_line.h"

namespace narpa {
namespace {

using Row = std::array<std::uint8_t, 100>;

FrameLedger random_ledger(std::mt19937_64& random) {
    const auto any_time = [&] { return static_cast<std::int64_t>(random()); };
    FrameLedger l;
    l.frame = static_cast<std::uint32_t>(random());
    l.camera = static_cast<std::uint8_t>(random());
    l.pose_counter = static_cast<std::uint8_t>(random());
    l.pose_stale = random() % 2 == 0;
    l.deadline_met = random() % 2 == 0;
    l.samples_per_pixel = static_cast<std::uint16_t>(random());
    l.expected_error = static_cast<float>(random() % 1000) / 1000.0F;
    l.t_pose_ns = any_time();
    l.t_exposure_start_ns = any_time();
    l.t_exposure_mid_ns = any_time();
    l.t_exposure_end_ns = any_time();
    l.t_render_start_ns = any_time();
    l.t_render_end_ns = any_time();
    l.t_hand_over_ns = any_time();
    l.t_deadline_ns = any_time();
    return l;
}

// The table of protocols/video/README.md; the CRC is Python's zlib.crc32 of the first 84 bytes.
TEST(EmbeddedLine, HasTheDocumentedBytes) {
    FrameLedger l;
    l.frame = 0x01020304;
    l.camera = 5;
    l.pose_counter = 6;
    l.pose_stale = true;
    l.deadline_met = true;
    l.samples_per_pixel = 0x0708;
    l.expected_error = 1.5F;
    l.t_pose_ns = -2;
    l.t_exposure_start_ns = 1;
    l.t_exposure_mid_ns = 2;
    l.t_exposure_end_ns = 3;
    l.t_render_start_ns = 4;
    l.t_render_end_ns = 5;
    l.t_hand_over_ns = 0;
    l.t_deadline_ns = 0x1122334455667788;
    Row row;
    row.fill(0xEE);
    ASSERT_TRUE(encode_embedded_line(l, row));
    const std::array<std::uint8_t, 100> expected{
        'N',  'R',  'P',  'A',  1,    88,   5,    6,    3,    0,    0x08, 0x07, 0x04, 0x03,
        0x02, 0x01, 0,    0,    0xC0, 0x3F, 0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF,  //
        1,    0,    0,    0,    0,    0,    0,    0,    2,    0,    0,    0,    0,    0,
        0,    0,    3,    0,    0,    0,    0,    0,    0,    0,  //
        4,    0,    0,    0,    0,    0,    0,    0,    5,    0,    0,    0,    0,    0,
        0,    0,    0,    0,    0,    0,    0,    0,    0,    0,                  //
        0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11, 0xB4, 0x39, 0x6F, 0xC7,   //
        0xEE, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE, 0xEE};  // still image
    EXPECT_EQ(row, expected);
}

TEST(EmbeddedLine, DecodeUndoesEncode) {
    std::mt19937_64 random(3);
    Row row{};
    for (int trial = 0; trial < 1000; ++trial) {
        const FrameLedger ledger = random_ledger(random);
        ASSERT_TRUE(encode_embedded_line(ledger, row));
        const auto decoded = decode_embedded_line(row);
        ASSERT_TRUE(decoded);
        EXPECT_EQ(*decoded, ledger);
    }
}

TEST(EmbeddedLine, NarrowRowIsLeftAlone) {
    std::vector<std::uint8_t> row(kEmbeddedLineBytes - 1, 7);
    EXPECT_FALSE(encode_embedded_line({}, row));
    EXPECT_TRUE(std::ranges::all_of(row, [](auto x) { return x == 7; }));
    EXPECT_FALSE(decode_embedded_line(row));
    EXPECT_FALSE(decode_embedded_line({}));
    row.push_back(7);
    EXPECT_TRUE(encode_embedded_line({}, row));
    EXPECT_TRUE(decode_embedded_line(row));
}

TEST(EmbeddedLine, AnyOneWrongBitIsFound) {
    std::mt19937_64 random(4);
    Row row{};
    ASSERT_TRUE(encode_embedded_line(random_ledger(random), row));
    for (std::size_t bit = 0; bit < 8 * kEmbeddedLineBytes; ++bit) {
        Row bad = row;
        bad[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
        EXPECT_FALSE(decode_embedded_line(bad)) << "bit " << bit;
    }
    row[kEmbeddedLineBytes] ^= 1;  // the image beside it is nobody's business
    EXPECT_TRUE(decode_embedded_line(row));
}

}  // namespace
}  // namespace narpa
