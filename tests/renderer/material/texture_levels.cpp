// Coarser levels of a texture against area means worked out texel by texel.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "renderer/material/texture/texture_lookup.h"

namespace narpa {
namespace {

Texture random_texture(int width, int height, unsigned seed = 1) {
    Texture t{.name = "random", .width = width, .height = height, .rgb = {}};
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> code(0, 65535);
    for (int i = 0; i < 3 * width * height; ++i) t.rgb.push_back(static_cast<std::uint16_t>(code(random)));
    return t;
}

/// Length of what the texel i of n has in common with the texel j of m, as a part of the image.
double common(int i, int n, int j, int m) {
    const double from = std::max(static_cast<double>(i) / n, static_cast<double>(j) / m);
    const double to = std::min((i + 1.0) / n, (j + 1.0) / m);
    return std::max(0.0, to - from);
}

double area_mean(const Texture& t, const Texture::Level& l, int x, int y, int band) {
    double sum = 0;
    for (int j = 0; j < t.height; ++j)
        for (int i = 0; i < t.width; ++i) {
            const auto at = static_cast<std::size_t>(3 * (j * t.width + i) + band);
            sum += t.rgb[at] * common(x, l.width, i, t.width) * common(y, l.height, j, t.height);
        }
    return sum * l.width * l.height;
}

TEST(TextureLevels, EveryTexelIsTheMeanOfItsAreaRoundedOnce) {
    for (const auto& [w, h] : {std::pair{2, 2}, {3, 3}, {5, 2}, {7, 1}, {1, 6}, {13, 9}, {16, 8}, {31, 17}}) {
        Texture t = random_texture(w, h);
        build_coarser_levels(t);
        for (const Texture::Level& l : t.coarser)
            for (int y = 0; y < l.height; ++y)
                for (int x = 0; x < l.width; ++x)
                    for (int band = 0; band < 3; ++band)
                        ASSERT_NEAR(l.rgb[static_cast<std::size_t>(3 * (y * l.width + x) + band)],
                                    area_mean(t, l, x, y, band), 0.5 + 1e-6)
                            << w << " x " << h << ": " << x << ", " << y << " of " << l.width << " x " << l.height;
    }
}

TEST(TextureLevels, HalveDownToASingleTexel) {
    Texture t = random_texture(13, 3);
    build_coarser_levels(t);
    std::vector<std::pair<int, int>> sizes;
    for (const Texture::Level& l : t.coarser) {
        sizes.emplace_back(l.width, l.height);
        EXPECT_EQ(l.rgb.size(), static_cast<std::size_t>(3 * l.width * l.height));
    }
    EXPECT_EQ(sizes, (std::vector<std::pair<int, int>>{{6, 1}, {3, 1}, {1, 1}}));
    build_coarser_levels(t);
    EXPECT_EQ(t.coarser.size(), 3u) << "made anew, not added to";
}

TEST(TextureLevels, KeepWhiteWhiteAndBlackBlack) {
    for (const int level : {0, 1, 32768, 65535}) {
        const auto code = static_cast<std::uint16_t>(level);
        Texture t{.name = "even", .width = 37, .height = 11, .rgb = std::vector<std::uint16_t>(3 * 37 * 11, code)};
        build_coarser_levels(t);
        for (const Texture::Level& l : t.coarser)
            EXPECT_TRUE(std::all_of(l.rgb.begin(), l.rgb.end(), [&](std::uint16_t c) { return c == code; }));
    }
}

TEST(TextureLevels, OneTexelHasNoneAndAnEmptyImageIsLeftAlone) {
    Texture one = random_texture(1, 1);
    build_coarser_levels(one);
    EXPECT_TRUE(one.coarser.empty());
    Texture none;
    build_coarser_levels(none);
    EXPECT_TRUE(none.coarser.empty());
    Texture torn = random_texture(4, 4);
    torn.rgb.resize(5);
    build_coarser_levels(torn);
    EXPECT_TRUE(torn.coarser.empty());
}

}  // namespace
}  // namespace narpa
