// Pixels without light: the table that they draw from, and that they draw as the others would.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "renderer/detector/dark_levels.h"
#include "renderer/detector/detector.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

double normal_below(double x) {
    return std::erfc(-x / std::sqrt(2.0)) / 2;
}
/// Of round(black + noise * normal), clamped.
double probability(int dn, double black, double noise, int top) {
    const double below = dn == 0 ? 0 : normal_below((dn - 0.5 - black) / noise),
                 up_to = dn == top ? 1 : normal_below((dn + 0.5 - black) / noise);
    return up_to - below;
}

/// How many of all words give each level.
std::vector<double> words_of_levels(const DarkLevels& dark, int top) {
    std::vector<double> words(static_cast<std::size_t>(top) + 1);
    for (std::uint32_t column = 0; column < DarkLevels::kColumns; ++column) {
        const std::uint32_t first = column << 24;
        std::uint32_t least = 0, most = 1u << 24;  // the other value begins between
        while (least < most) {
            const std::uint32_t middle = (least + most) / 2;
            if (dark.level(first | middle) == dark.level(first))
                least = middle + 1;
            else
                most = middle;
        }
        words.at(dark.level(first)) += least;
        words.at(dark.level(first | 0xffffffu)) += (1u << 24) - least;
    }
    return words;
}

struct Noise {
    double black, noise;
    int top;
};
TEST(DarkLevels, ProbabilitiesAreThoseOfTheRoundedNormal) {
    for (const auto& [black, noise, top] : {Noise{64, 3.9, 4095},
                                            {64.3, 0.7, 1023},
                                            {0, 2, 255},
                                            {2, 5, 255},
                                            {254, 3, 255},
                                            {-3, 1, 255},
                                            {40, 1e-3, 4095},
                                            {10.5, 1e-9, 255},
                                            {300, 2, 255},
                                            {900.3, 19.5, 65535},
                                            {128, 1000 / 6.5 / 8, 255}}) {
        SCOPED_TRACE(::testing::Message() << black << " +- " << noise);
        const DarkLevels dark(black, noise, top);
        ASSERT_TRUE(dark.any());
        const std::vector<double> words = words_of_levels(dark, top);
        double sum = 0;
        for (int dn = 0; dn <= top; ++dn) {
            const double n = words[static_cast<std::size_t>(dn)];
            ASSERT_NEAR(n, 0x1p32 * probability(dn, black, noise, top), 1.001) << dn;  // both ends round
            sum += n;
        }
        EXPECT_EQ(sum, 0x1p32);
    }
}

TEST(DarkLevels, AreNoneWhereATableWillNotDo) {
    EXPECT_FALSE(DarkLevels().any());
    for (const double noise : {0.0, -1.0, 20.0, 1e30, std::nan(""), double{INFINITY}})
        EXPECT_FALSE(DarkLevels(500, noise, 4095).any()) << noise;
    EXPECT_TRUE(DarkLevels(10, 30, 100).any());  // so few numbers that all have a column
}

Camera noisy(int width, int height) {
    Camera c = camera(width, height, 100);
    c.format = PixelFormat::y16;
    c.detector = Detector{};
    c.detector->shot_noise = true;
    c.detector->read_noise_e = 13;
    c.detector->full_well_e = 13'500;
    c.detector->black_level_dn = 5;
    return c;
}
std::vector<int> dn_of_image(const Camera& c, const RadianceImage& image, std::uint64_t seed, std::uint32_t frame) {
    std::vector<std::uint8_t> bytes(frame_bytes({c.width, c.height, c.format, 0}));
    expose(c, image, seed, frame, bytes);
    std::vector<int> dn(bytes.size() / 2);
    for (std::size_t i = 0; i < dn.size(); ++i)
        dn[i] = (bytes[2 * i] | (bytes[2 * i + 1] << 8)) >> (16 - c.detector->bits);
    return dn;
}

TEST(DarkPixels, DrawAsPixelsOfVanishingLightDo) {
    const Camera c = noisy(1000, 1000);
    const double gain = gain_e_per_dn(*c.detector), noise = 13 / gain;
    constexpr double n = 1e6;
    // A quantum in 1e9 pixels takes the long way, and changes nothing.
    for (const double electrons : {0.0, 1e-9}) {
        RadianceImage image(c.width, c.height);
        const auto light = static_cast<float>(electrons / electrons_per_radiance(*c.detector, 0));
        std::fill(image.pixels.begin(), image.pixels.end(), Rgb{light, 0, 0});
        const std::vector<int> dn = dn_of_image(c, image, 11, 4);

        std::vector<double> count(4096), expected(4096);
        double mean = 0, true_mean = 0, square = 0, true_square = 0;
        for (const int v : dn) ++count.at(static_cast<std::size_t>(v));
        for (int v = 0; v < 4096; ++v) {
            const auto i = static_cast<std::size_t>(v);
            expected[i] = n * probability(v, 5, noise, 4095);
            mean += v * count[i] / n, square += v * v * count[i] / n;
            true_mean += v * expected[i] / n, true_square += v * v * expected[i] / n;
        }
        // Levels expected less than ten times are counted as one.
        double chi_squared = 0, rare = 0, rare_expected = 0;
        int classes = 0;
        for (std::size_t i = 0; i < 4096; ++i) {
            if (expected[i] < 10) {
                rare += count[i], rare_expected += expected[i];
                continue;
            }
            chi_squared += (count[i] - expected[i]) * (count[i] - expected[i]) / expected[i];
            ++classes;
        }
        chi_squared += (rare - rare_expected) * (rare - rare_expected) / rare_expected;
        // `classes` degrees of freedom; beyond 4 standard deviations and a bit, for the skewness, once in 1e4.
        EXPECT_GT(classes, 15);
        EXPECT_LT(chi_squared, classes + 4.5 * std::sqrt(2.0 * classes)) << electrons;
        const double variance = true_square - true_mean * true_mean;
        EXPECT_NEAR(mean, true_mean, 4 * std::sqrt(variance / n)) << electrons;
        EXPECT_NEAR((square - mean * mean) / variance, 1, 4 * std::sqrt(2 / n)) << electrons;
    }
}

TEST(DarkPixels, DrawIndependently) {
    const Camera c = noisy(500, 500);
    const RadianceImage black(c.width, c.height);
    const std::vector<int> dn = dn_of_image(c, black, 7, 1);
    EXPECT_EQ(dn, dn_of_image(c, black, 7, 1));
    const auto correlation = [&](const std::vector<int>& a, const std::vector<int>& b, std::size_t lag) {
        const auto n = static_cast<double>(a.size());
        double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
        for (std::size_t i = 0; i < a.size(); ++i) sum_a += a[i], sum_b += b[i];
        for (std::size_t i = 0; i < a.size(); ++i) {
            const double x = a[i] - sum_a / n, y = b[(i + lag) % b.size()] - sum_b / n;
            aa += x * x, bb += y * y, ab += x * y;
        }
        return ab / std::sqrt(aa * bb);
    };
    const double most = 4.5 / std::sqrt(static_cast<double>(dn.size()));
    for (const std::size_t lag : {1, 2, 15, 16, 17, 32, 48, 64, 256, 500, 1024})
        EXPECT_LT(std::abs(correlation(dn, dn, lag)), most) << lag;
    EXPECT_LT(std::abs(correlation(dn, dn_of_image(c, black, 7, 2), 0)), most);
    EXPECT_LT(std::abs(correlation(dn, dn_of_image(c, black, 8, 1), 0)), most);
    EXPECT_LT(std::abs(correlation(dn, dn_of_image(c, black, std::uint64_t{1} << 32 | 7, 1), 0)), most);
    // Nor do they share anything with what they would draw if they had light.
    RadianceImage faint(c.width, c.height);
    std::fill(faint.pixels.begin(), faint.pixels.end(), Rgb{1e-12f, 0, 0});
    EXPECT_LT(std::abs(correlation(dn, dn_of_image(c, faint, 7, 1), 0)), most);
}

TEST(DarkPixels, AreNotChangedByTheLightOfOthers) {
    const Camera c = noisy(400, 100);
    const RadianceImage black(c.width, c.height);
    RadianceImage lit(c.width, c.height), some(c.width, c.height);
    std::fill(lit.pixels.begin(), lit.pixels.end(), Rgb{3, 4, 5});
    for (std::size_t i = 0; i < some.pixels.size(); ++i)
        if (i % 7 == 3 || i / 1000 % 3 == 0) some.pixels[i] = lit.pixels[i];
    const std::vector<int> dark_dn = dn_of_image(c, black, 2, 3), lit_dn = dn_of_image(c, lit, 2, 3),
                           dn = dn_of_image(c, some, 2, 3);
    for (std::size_t i = 0; i < dn.size(); ++i)
        ASSERT_EQ(dn[i], (some.pixels[i] == black.pixels[i] ? dark_dn : lit_dn)[i]) << i;
}

}  // namespace
}  // namespace narpa
