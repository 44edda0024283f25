// Filtered lookups: what they keep (detail, brightness, edges) and what they take away (aliases).
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "renderer/material/texture/texture_lookup.h"
#include "tests/renderer/material/texture_support.h"

namespace narpa {
namespace {

using namespace test;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Texture noise(int width, int height, Texture::Wrap wrap = Texture::Wrap::repeat, unsigned seed = 3) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> any;
    return make(
        width, height, [&](int, int) { return any(random); }, wrap);
}

/// Half axes in texels of the finest level, turned by `angle` from u towards v.
TextureFootprint ellipse(const Texture& t, double a, double b, double angle = 0) {
    const double c = std::cos(angle), s = std::sin(angle);
    const auto f = [](double x, int n) { return static_cast<float>(x / n); };
    return {{f(a * c, t.width), f(a * s, t.height)}, {f(-b * s, t.width), f(b * c, t.height)}};
}

TEST(TextureFilter, IsTheBilinearValueUpToOneTexel) {
    const Texture t = noise(37, 20);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> any(-2, 3), half(0, 0.5f);
    for (int i = 0; i < 2000; ++i) {
        const float u = any(random), v = any(random);
        const double a = static_cast<double>(half(random)) * 0.999, b = static_cast<double>(half(random)) * 0.999;
        EXPECT_EQ(texture_lookup(t, u, v, ellipse(t, a, b, static_cast<double>(u))), texture_lookup(t, u, v));
        EXPECT_EQ(texture_lookup(t, u, v, TextureFootprint{}), texture_lookup(t, u, v));
    }
}

TEST(TextureFilter, GoesFromOneSizeToTheNextWithoutAStep) {
    const Texture t = noise(256, 128);
    for (const double aspect : {1.0, 3.0, 12.0, 40.0})
        for (const double angle : {0.0, 0.4, std::numbers::pi / 2}) {
            const auto look = [&](double width) {
                return texture_lookup(t, 0.317f, 0.722f, ellipse(t, 0.5 * width * aspect, 0.5 * width, angle)).x;
            };
            float last = texture_lookup(t, 0.317f, 0.722f).x;
            // A tenth of a per cent wider each time. White noise of standard deviation 0.29 whose filter loses or
            // gains a whole lookup would jump by about 0.1; drawn out it moves by a few parts in a thousand.
            for (double width = 0.9 / aspect; width < 200; width *= 1.001) {
                const float now = look(width);
                ASSERT_NEAR(now, last, 0.008f) << width << " x " << aspect << " at " << angle;
                last = now;
            }
        }
}

TEST(TextureFilter, KeepsTheMeanOfTheImage) {
    const Texture t = noise(48, 20);  // 20 halves to odd sizes: 5
    const double mean = mean_of(t);
    for (const double width : {0.5, 1.3, 2.0, 5.7, 11.0, 300.0})
        for (const double aspect : {1.0, 6.5, 30.0}) {
            const TextureFootprint f = ellipse(t, 0.5 * width * aspect, 0.5 * width, 0.7);
            double sum = 0;
            constexpr int n = 240, m = 120;  // multiples of every level's size
            for (int j = 0; j < m; ++j)
                for (int i = 0; i < n; ++i)
                    sum += static_cast<double>(
                        texture_lookup(t, (static_cast<float>(i) + 0.5f) / n, (static_cast<float>(j) + 0.5f) / m, f)
                            .y);
            EXPECT_NEAR(sum / (n * m), mean, 1e-5) << width << " x " << aspect;  // half a code of each level
        }
}

TEST(TextureFilter, TakesAnyConjugateHalfAxesOfTheSameEllipse) {
    const Texture t = noise(64, 64);
    const TextureFootprint f = ellipse(t, 9, 2.5, 0.3);
    const float expected = texture_lookup(t, 0.4f, 0.6f, f).x;
    for (double a = 0.1; a < 6; a += 0.37) {
        const auto c = static_cast<float>(std::cos(a)), s = static_cast<float>(std::sin(a));
        TextureFootprint turned;
        for (std::size_t k = 0; k < 2; ++k) {
            turned.axis1[k] = c * f.axis1[k] + s * f.axis2[k];
            turned.axis2[k] = c * f.axis2[k] - s * f.axis1[k];
        }
        EXPECT_NEAR(texture_lookup(t, 0.4f, 0.6f, turned).x, expected, 1e-5f) << a;
    }
}

/// Largest less smallest of lookups along u.
double contrast(const Texture& t, const TextureFootprint& f) {
    float least = 1, most = 0;
    for (float u = 0.2f; u < 0.4f; u += 0.0007f) {
        const float c = texture_lookup(t, u, 0.43f, f).x;
        least = std::min(least, c), most = std::max(most, c);
    }
    return static_cast<double>(most - least);
}

TEST(TextureFilter, BlursOnlyAlongTheLongerAxis) {
    // Stripes that change along u every 8 texels, seen through 2 x 24 texels.
    const Texture t = make(256, 256, [](int x, int) { return x / 8 % 2; });
    EXPECT_GT(contrast(t, ellipse(t, 1, 12, 0)), 0.95) << "along the stripes";
    EXPECT_LT(contrast(t, ellipse(t, 12, 1, 0)), 0.40) << "across them";
    EXPECT_LT(contrast(t, ellipse(t, 12, 12)), 0.25) << "both ways, as without anisotropy";
    // The same for stripes along a diagonal.
    const Texture d = make(256, 256, [](int x, int y) { return ((x + y) & 255) / 16 % 2; });  // y down: along v = u
    const double diagonal = std::numbers::pi / 4;
    EXPECT_GT(contrast(d, ellipse(d, 12, 1, diagonal)), 0.95);
    EXPECT_LT(contrast(d, ellipse(d, 1, 24, diagonal)), 0.40);
}

TEST(TextureFilter, BeyondTheMostLookupsItIsBlurredRatherThanAliased) {
    const Texture t = noise(512, 512);
    double squares = 0;
    constexpr int n = 500;
    for (int i = 0; i < n; ++i) {
        const float u = static_cast<float>(i) * 0.618034f, v = static_cast<float>(i) * 0.414214f;
        const double c = static_cast<double>(texture_lookup(t, u, v, ellipse(t, 200, 0.5, 0.5)).x) - 0.5;
        squares += c * c;
    }
    // 15 lookups of width 27: the mean of 400 x 27 texels of standard deviation 0.29; lookups in the finest level
    // alone would leave 0.29 x 2/3 / sqrt(15) = 0.05.
    EXPECT_LT(std::sqrt(squares / n), 0.006);
}

TEST(TextureWrap, RepeatComesBackAfterAWholeTurnAtEveryLevel) {
    const Texture t = noise(24, 10);
    for (const double width : {0.0, 1.0, 2.7, 6.0, 15.0, 100.0})
        for (const float u : {0.0f, 0.01f, 0.3125f, 0.984375f})
            for (const float v : {0.0f, 0.015625f, 0.5f, 0.9921875f}) {
                const TextureFootprint f = ellipse(t, 2 * width, width, 0.3);
                const Rgb here = texture_lookup(t, u, v, f);
                for (const auto& [i, j] : {std::pair{1.0f, 0.0f}, {0.0f, 1.0f}, {-3.0f, 7.0f}})
                    EXPECT_NEAR(texture_lookup(t, u + i, v + j, f).x, here.x, 1e-4f) << width;
            }
}

TEST(TextureWrap, ClampGoesOnWithTheEdgeAndNeverSeesTheOppositeOne) {
    // Left of the middle black, right of it white; the same for below and above.
    for (const bool along_u : {true, false}) {
        const auto half = [&](int x, int y) { return along_u ? x >= 32 : y < 32; };
        const Texture clamped = make(64, 64, half, Texture::Wrap::clamp), repeated = make(64, 64, half);
        const auto at = [&](const Texture& t, float x, const TextureFootprint& f) {
            return along_u ? texture_lookup(t, x, 0.3f, f).x : texture_lookup(t, 0.3f, x, f).x;
        };
        for (const double width : {0.1, 1.0, 2.0, 4.0, 8.0, 16.0}) {
            const TextureFootprint f = ellipse(clamped, 0.5 * width, 0.5 * width);
            for (const float beyond : {0.0f, -0.001f, -0.4f, -7.0f}) EXPECT_EQ(at(clamped, beyond, f), 0) << width;
            for (const float beyond : {1.0f, 1.001f, 1.4f, 9.0f}) EXPECT_EQ(at(clamped, beyond, f), 1) << width;
            EXPECT_NEAR(at(repeated, 0, f), 0.5f, 1e-5f) << width;
            EXPECT_NEAR(at(repeated, 1, f), 0.5f, 1e-5f) << width;
        }
    }
}

TEST(TextureWrap, CornersOfEveryLevelAreTheCornerTexel) {
    const Texture t = noise(12, 6, Texture::Wrap::clamp);
    for (std::size_t level = 0; level <= t.coarser.size(); ++level) {
        const int w = level == 0 ? t.width : t.coarser[level - 1].width;
        const auto& rgb = level == 0 ? t.rgb : t.coarser[level - 1].rgb;
        const double width = std::pow(2.0, level);
        const auto near = [&](float u, float v, std::size_t texel) {
            const Rgb c = texture_lookup(t, u, v, ellipse(t, 0.5 * width, 0.5 * width));
            EXPECT_NEAR(c.x, rgb[3 * texel] / 65535.0, 1e-5) << level;
        };
        const std::size_t last = rgb.size() / 3 - 1;
        near(0, 1, 0);
        near(1, 1, static_cast<std::size_t>(w - 1));
        near(0, 0, last - static_cast<std::size_t>(w - 1));
        near(1, 0, last);
    }
}

TEST(TextureGlobe, PolesMeetTheirOtherSideAndNeverEachOther) {
    const Texture halves = make(64, 32, [](int, int y) { return y < 16; });  // wraps, by itself
    for (const double width : {0.0, 1.5, 3.0, 7.0})
        for (const float u : {0.0f, 0.2f, 0.99f}) {
            const TextureFootprint f = ellipse(halves, width, width);
            EXPECT_EQ(texture_lookup(halves, u, 1, f, TextureLayout::globe).x, 1) << width;
            EXPECT_EQ(texture_lookup(halves, u, 0, f, TextureLayout::globe).x, 0) << width;
        }
    EXPECT_EQ(texture_lookup(halves, 0.3f, 1, {}, TextureLayout::globe).x, 1);
    EXPECT_NEAR(texture_lookup(halves, 0.3f, 1).x, 0.5f, 1e-5f) << "flat and repeated";

    const Texture t = noise(64, 32);
    for (const float beyond : {0.01f, 0.1f, 0.37f})
        for (const float u : {0.1f, 0.6f}) {
            const auto look = [&](float x, float y) { return texture_lookup(t, x, y, {}, TextureLayout::globe).x; };
            EXPECT_NEAR(look(u, 1 + beyond), look(u + 0.5f, 1 - beyond), 1e-4f);
            EXPECT_NEAR(look(u, -beyond), look(u + 0.5f, beyond), 1e-4f);
            EXPECT_NEAR(look(u, 2 + beyond), look(u, beyond), 1e-4f);
        }
}

TEST(TextureSound, SmallestImages) {
    const Texture one = make(1, 1, [](int, int) { return 0.25; });
    const Texture row = make(7, 1, [](int x, int) { return x / 7.0; }),
                  column = make(1, 5, [](int, int y) { return y / 5.0; });
    for (const double width : {0.0, 1.0, 3.0, 100.0})
        for (float at = -1; at < 2; at += 0.125f) {
            EXPECT_NEAR(texture_lookup(one, at, -at, ellipse(one, width, 2 * width)).x, 0.25f, 1e-5f);
            for (const Texture* t : {&row, &column}) {
                const float c = texture_lookup(*t, at, at, ellipse(*t, width, 2 * width)).x;
                EXPECT_TRUE(c >= 0 && c <= 0.9f) << c;
            }
        }
    EXPECT_NEAR(texture_lookup(row, 2.5f / 7, 0.9f).x, 2.0 / 7, 1e-5);
    EXPECT_NEAR(texture_lookup(column, 0.9f, 2.5f / 5).x, 2.0 / 5, 1e-5);
    EXPECT_NEAR(texture_lookup(row, 0.1f, 0.1f, ellipse(row, 50, 50)).x, 3.0 / 7, 1e-4);
    EXPECT_EQ(texture_lookup(Texture{}, 0.5f, 0.5f), (Rgb{1, 1, 1}));
    EXPECT_EQ(texture_lookup(Texture{}, 0.5f, 0.5f, TextureFootprint{}), (Rgb{1, 1, 1}));
}

TEST(TextureSound, AnyNumberGivesAValueOfTheImage) {
    const std::array odd{0.0f,  -0.0f,  1.0f,    1e-42f, -1e-30f, 16777217.0f, -4e9f,
                         1e19f, -1e30f, 3.4e38f, kInf,   -kInf,   kNan};
    for (const Texture::Wrap wrap : {Texture::Wrap::repeat, Texture::Wrap::clamp}) {
        Texture t = noise(6, 9, wrap);
        for (const bool levels : {true, false}) {
            if (!levels) t.coarser.clear();
            for (const TextureLayout layout : {TextureLayout::flat, TextureLayout::globe})
                for (const float u : odd)
                    for (const float v : odd)
                        for (const float a : odd)
                            for (const float b : odd) {
                                const Rgb c = texture_lookup(t, u, v, {{a, b}, {b, 0.1f}}, layout);
                                ASSERT_TRUE(c.x >= 0 && c.x <= 1) << u << " " << v << " " << a << " " << b;
                                const TextureSlope s = texture_slope(t, u, v, {{a, b}, {b, 0.1f}}, layout);
                                ASSERT_TRUE(std::isfinite(s.du) && std::isfinite(s.dv));
                            }
        }
    }
    const Texture t = noise(6, 9);
    EXPECT_EQ(texture_lookup(t, kNan, 0.5f), (Rgb{1, 1, 1}));
    EXPECT_EQ(texture_lookup(t, 0.5f, kInf), (Rgb{1, 1, 1}));
}

TEST(TextureSound, WhiteIsOneAndNeverMore) {
    const Texture t = make(33, 12, [](int, int) { return 1; });
    std::mt19937 random(5);
    std::uniform_real_distribution<float> any(-1, 2);
    for (int i = 0; i < 2000; ++i) {
        const float u = any(random), v = any(random);
        const double a = std::pow(10.0, static_cast<double>(any(random)));
        EXPECT_LE(texture_lookup(t, u, v).x, 1.0f);
        EXPECT_LE(texture_lookup(t, u, v, ellipse(t, 7 * a, a, 0.3)).x, 1.0f);
        EXPECT_NEAR(texture_lookup(t, u, v, ellipse(t, 7 * a, a, 0.3)).x, 1, 5e-7f);
    }
}

TEST(TextureSlope, OfARampIsItsSlopeAtEveryLevel) {
    const Texture t = make(64, 64, [](int x, int y) { return (x + 0.5) / 128 + (y + 0.5) / 256; });
    for (const double width : {0.1, 1.0, 1.7, 4.0}) {
        const TextureSlope s = texture_slope(t, 0.5f, 0.5f, ellipse(t, 0.5 * width, 0.5 * width));
        EXPECT_NEAR(s.du, 0.5f, 0.001f) << width;
        EXPECT_NEAR(s.dv, -0.25f, 0.001f) << width;
    }
}

}  // namespace
}  // namespace narpa
