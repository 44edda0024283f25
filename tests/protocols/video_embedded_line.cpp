#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "protocols/video/embedded_line.h"

namespace narpa {
namespace {

using Row = std::array<std::uint8_t, 172>;

FrameLedger random_ledger(std::mt19937_64& random) {
    const auto any_time = [&] { return static_cast<std::int64_t>(random()); };
    FrameLedger l;
    l.frame = static_cast<std::uint32_t>(random());
    l.camera = static_cast<std::uint8_t>(random());
    l.pose_counter = static_cast<std::uint8_t>(random());
    l.pose_stale = random() % 2 == 0;
    l.deadline_met = random() % 2 == 0;
    l.step = static_cast<std::uint8_t>(random() % kStepNames.size());
    l.budget_kind = static_cast<BudgetKind>(random() % kBudgetKinds.size());
    l.budget = random();
    l.samples = random();
    l.rays = random();
    for (std::uint32_t& samples : l.passes) samples = static_cast<std::uint32_t>(random());
    l.samples_per_pixel = static_cast<float>(random() % 1'000'000) / 1000.0F;
    l.expected_error = static_cast<float>(random() % 1000) / 1000.0F;
    l.t_pose_ns = any_time();
    l.t_exposure_start_ns = any_time();
    l.t_exposure_mid_ns = any_time();
    l.t_exposure_end_ns = any_time();
    l.t_render_start_ns = any_time();
    l.t_render_end_ns = any_time();
    l.t_hand_over_ns = any_time();
    l.t_deadline_ns = any_time();
    l.command_counter = static_cast<std::uint8_t>(random());
    l.region_x = static_cast<std::uint16_t>(random()), l.region_y = static_cast<std::uint16_t>(random());
    l.region_width = static_cast<std::uint16_t>(random()), l.region_height = static_cast<std::uint16_t>(random());
    l.gain_cdb = static_cast<std::int16_t>(random());
    l.binning = static_cast<std::uint8_t>(random());
    l.trigger = static_cast<TriggerMode>(random() % kTriggerModes.size());
    return l;
}

// The table of protocols/video/README.md; the bytes are Python's struct.pack, the CRC its zlib.crc32 of the first
// 156.
TEST(EmbeddedLine, HasTheDocumentedBytes) {
    FrameLedger l;
    l.frame = 0x01020304;
    l.camera = 5;
    l.pose_counter = 6;
    l.pose_stale = true;
    l.deadline_met = true;
    l.step = 4;
    l.budget_kind = BudgetKind::time;
    l.samples_per_pixel = 2.25F;
    l.samples = 0x1112131415161718;
    l.rays = 0x2122;
    l.budget = 0x3132;
    l.passes = {0x41424344, 2, 3, 4, 5, 6, 7, 0x51525354};
    l.expected_error = 1.5F;
    l.t_pose_ns = -2;
    l.t_exposure_start_ns = 1;
    l.t_exposure_mid_ns = 2;
    l.t_exposure_end_ns = 3;
    l.t_render_start_ns = 4;
    l.t_render_end_ns = 5;
    l.t_hand_over_ns = 0;
    l.t_deadline_ns = 0x1122334455667788;
    l.command_counter = 0x61;
    l.region_x = 0x7172, l.region_y = 0x73, l.region_width = 0x74, l.region_height = 0x7576;
    l.gain_cdb = -2;
    l.binning = 4;
    l.trigger = TriggerMode::sync;
    Row row;
    row.fill(0xEE);
    ASSERT_TRUE(encode_embedded_line(l, row));
    Row expected{0x4E, 0x52, 0x50, 0x41, 0x03, 0xA0, 0x05, 0x06, 0x03, 0x04, 0x02, 0x61, 0x04, 0x03, 0x02, 0x01,
                 0x00, 0x00, 0x10, 0x40, 0x00, 0x00, 0xC0, 0x3F, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11,
                 0x22, 0x21, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x32, 0x31, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
                 0x44, 0x43, 0x42, 0x41, 0x02, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x00, 0x04, 0x00, 0x00, 0x00,
                 0x05, 0x00, 0x00, 0x00, 0x06, 0x00, 0x00, 0x00, 0x07, 0x00, 0x00, 0x00, 0x54, 0x53, 0x52, 0x51,
                 0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
                 0x02, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
                 0x04, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x05, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
                 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11,
                 0x72, 0x71, 0x73, 0x00, 0x74, 0x00, 0x76, 0x75, 0xFE, 0xFF, 0x04, 0x02, 0xD4, 0x5B, 0xEB, 0x31};
    std::fill(expected.begin() + kEmbeddedLineBytes, expected.end(), 0xEE);  // still image
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

TEST(EmbeddedLine, UnknownChoicesAreRefused) {
    Row row{};
    FrameLedger ledger;
    ledger.step = 7;
    ASSERT_TRUE(encode_embedded_line(ledger, row));
    EXPECT_FALSE(decode_embedded_line(row));
    ledger.step = 6;
    ledger.budget_kind = static_cast<BudgetKind>(3);
    ASSERT_TRUE(encode_embedded_line(ledger, row));
    EXPECT_FALSE(decode_embedded_line(row));
    ledger.budget_kind = BudgetKind::time;
    ledger.trigger = static_cast<TriggerMode>(kTriggerModes.size());
    ASSERT_TRUE(encode_embedded_line(ledger, row));
    EXPECT_FALSE(decode_embedded_line(row));
}

}  // namespace
}  // namespace narpa
