// Test patterns against their definitions, computed in another way.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "protocols/little_endian.h"
#include "protocols/video/test_pattern.h"

namespace narpa {
namespace {

TEST(VideoTestPattern, TheCounterCountsPixelsAndFrames) {
    std::vector<std::uint8_t> bytes(2 * 5000);
    fill_counter(PixelFormat::y16, 12, 4090, bytes);
    for (std::size_t i = 0; i < 5000; ++i)
        ASSERT_EQ(get_le<std::uint16_t>(&bytes[2 * i]), (i + 4090) % 4096 * 16) << "left-justified; " << i;
    fill_counter(PixelFormat::grey, 12, 1000, bytes);
    for (std::size_t i = 0; i < bytes.size(); ++i) ASSERT_EQ(bytes[i], (i + 1000) % 256) << i;
}

/// The bits of a pattern in their order.
std::vector<int> bits_of(PixelFormat format, int bits, std::uint32_t frame, std::size_t samples) {
    std::vector<std::uint8_t> bytes(samples * bytes_per_pixel(format));
    fill_prbs(format, bits, frame, bytes);
    std::vector<int> sequence;
    for (std::size_t i = 0; i < samples; ++i) {
        const int value =
            format == PixelFormat::grey ? bytes[i] : get_le<std::uint16_t>(&bytes[2 * i]) >> (16 - bits);
        for (int b = bits - 1; b >= 0; --b) sequence.push_back(value >> b & 1);
    }
    return sequence;
}

TEST(VideoTestPattern, TheRandomBitsObeyTheirPolynomial) {
    for (const auto& [format, bits] : {std::pair{PixelFormat::grey, 8},
                                       {PixelFormat::y16, 10},
                                       {PixelFormat::rggb16, 12},
                                       {PixelFormat::y16, 16}}) {
        const std::vector<int> s = bits_of(format, bits, 7, 20'000);
        for (std::size_t i = 23; i < s.size(); ++i) ASSERT_EQ(s[i], s[i - 23] ^ s[i - 18]) << bits << " " << i;
        EXPECT_EQ(s, bits_of(format, bits, 7 + (1 << 22), 20'000));
        EXPECT_NE(s, bits_of(format, bits, 8, 20'000));
    }
}

// From a register of ones the first 18 bits are 0 (1 xor 1), the next five 1 (1 xor 0).
TEST(VideoTestPattern, TheRandomBitsOfFrame0BeginAsFromARegisterOfOnes) {
    const std::vector<int> s = bits_of(PixelFormat::grey, 8, 0, 3);
    for (std::size_t i = 0; i < 23; ++i) EXPECT_EQ(s[i], i < 18 ? 0 : 1) << i;
}

// A sequence of the longest period: 2^23 - 1 bits, of which 2^22 are 1.
TEST(VideoTestPattern, TheRandomBitsHaveTheLongestPeriod) {
    constexpr std::size_t kPeriod = (1u << 23) - 1;
    const std::vector<int> s = bits_of(PixelFormat::grey, 8, 0, (kPeriod + 31) / 8);
    EXPECT_EQ(std::count(s.begin(), s.begin() + kPeriod, 1), 1 << 22);
    EXPECT_TRUE(std::equal(s.begin() + kPeriod, s.begin() + kPeriod + 23, s.begin()));
}

}  // namespace
}  // namespace narpa
