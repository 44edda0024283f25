#include <gtest/gtest.h>

#include <random>
#include <string_view>
#include <vector>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"
#include "protocols/video/bulk_frame.h"

namespace narpa {
namespace {

using BulkBytes = std::array<std::uint8_t, kBulkHeaderBytes>;

std::span<const std::uint8_t> text_bytes(std::string_view text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// As a sender of other values would.
BulkBytes with(BulkBytes bytes, std::size_t at, std::uint32_t value) {
    put_le(&bytes[at], value);
    put_le(&bytes[44], crc32(std::span(bytes).first(44)));
    return bytes;
}

TEST(Crc32, IsThatOfZlib) {
    EXPECT_EQ(crc32(text_bytes("123456789")), 0xCBF4'3926u);
    EXPECT_EQ(crc32({}), 0u);
    std::mt19937 random(5);
    std::vector<std::uint8_t> bytes(1000);
    for (auto& b : bytes) b = static_cast<std::uint8_t>(random());
    for (std::size_t n = 0; n < bytes.size(); n += 37) {
        std::uint32_t slow = 0xFFFF'FFFF;  // bit by bit, as the polynomial says
        for (const std::uint8_t b : bytes) {
            slow ^= b;
            for (int bit = 0; bit < 8; ++bit) slow = (slow >> 1) ^ ((slow & 1) != 0 ? 0xEDB8'8320u : 0);
        }
        const auto all = std::span<const std::uint8_t>(bytes);
        EXPECT_EQ(crc32(all), ~slow);
        EXPECT_EQ(crc32(all.subspan(n), crc32(all.first(n))), ~slow) << "in two pieces, the first of " << n;
    }
}

// The table of protocols/video/README.md; the bytes are Python's struct.pack, the CRC its zlib.crc32.
TEST(BulkFrame, HeaderHasTheDocumentedBytes) {
    const BulkBytes expected{'N',  'R',  'P',  'F',  0x01, 0x00, 0x30, 0x00, 0xFE, 0xFF, 0xFF, 0xFF,
                             0xFF, 0xFF, 0xFF, 0xFF, 0x04, 0x03, 0x02, 0x01, 'Y',  '1',  '6',  ' ',
                             0x80, 0x02, 0x00, 0x00, 0xE0, 0x01, 0x00, 0x00, 0x00, 0x05, 0x00, 0x00,
                             0x00, 0x60, 0x09, 0x00, 0x44, 0x33, 0x22, 0x11, 0x3F, 0x2E, 0x07, 0x92};
    const BulkFrameHeader h{-2, 0x01020304, PixelFormat::y16, 640, 480, 0x11223344};
    EXPECT_EQ(encode_bulk_header(h), expected);
    EXPECT_EQ(decode_bulk_header(expected), h);
}

TEST(BulkFrame, EveryFormatIsReadAgain) {
    for (std::size_t i = 0; i < kPixelFormatNames.size(); ++i) {
        const BulkFrameHeader h{1'234'567'890'123, 7, static_cast<PixelFormat>(i), 64, 48, 9};
        EXPECT_EQ(decode_bulk_header(encode_bulk_header(h)), h) << kPixelFormatNames[i];
    }
}

TEST(BulkFrame, AnyOneWrongBitIsFound) {
    const BulkBytes good = encode_bulk_header({5, 6, PixelFormat::yuyv, 64, 48, 7});
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
        BulkBytes bad = good;
        bad[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
        EXPECT_FALSE(decode_bulk_header(bad)) << "bit " << bit;
    }
    EXPECT_FALSE(decode_bulk_header(std::span(good).first(47)));
    EXPECT_FALSE(decode_bulk_header({}));
}

TEST(BulkFrame, SizesThatDoNotAgreeAreRefused) {
    const BulkBytes good = encode_bulk_header({5, 6, PixelFormat::grey, 64, 48, 7});
    ASSERT_TRUE(decode_bulk_header(with(good, 40, 8))) << "another CRC of the pixels";
    for (const auto& [at, value, what] : {std::tuple<std::size_t, std::uint32_t, const char*>{24, 65, "width"},
                                          {28, 0, "no height"},
                                          {28, 49, "height"},
                                          {32, 65, "row"},
                                          {36, 0, "no pixels"},
                                          {36, 3073, "size"},
                                          {20, 0x20202020, "format"},
                                          {4, 0x0030'0002, "version"}})
        EXPECT_FALSE(decode_bulk_header(with(good, at, value))) << what;
    // 2^32 bytes and more: the size does not fit its field.
    EXPECT_FALSE(decode_bulk_header(encode_bulk_header({5, 6, PixelFormat::y16, 65536, 32768, 7})));
}

}  // namespace
}  // namespace narpa
