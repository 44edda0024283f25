// How far a picture is from a better one: places and structure, against what is known of them.
#include "emulator/replay/image_compare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace narpa::test {
namespace {

constexpr int kSize = 64;
constexpr double kFullScale = 2;

/// A bright ball with an outline blurred as by a lens, its centre at (x, y).
RadianceImage ball(double x, double y, float level = 1.5f) {
    RadianceImage image(kSize, kSize);
    for (int row = 0; row < kSize; ++row)
        for (int column = 0; column < kSize; ++column) {
            const double beyond = std::hypot(column - x, row - y) - 12;
            const auto light = static_cast<float>(0.5 * std::erfc(beyond / 1.2)) * level;
            image.pixels[static_cast<std::size_t>(row * kSize + column)] = {light, light, light};
        }
    return image;
}

std::vector<std::int32_t> body_of_ball() {
    std::vector<std::int32_t> body(kSize * kSize, -1);
    for (int row = 0; row < kSize; ++row)
        for (int column = 0; column < kSize; ++column)
            if (std::hypot(column - 31, row - 31) < 12) body[static_cast<std::size_t>(row * kSize + column)] = 3;
    return body;
}

TEST(ImageCompare, ThePictureItselfIsNoWayOff) {
    const ImageDifference d = compare(ball(31, 31), ball(31, 31), body_of_ball(), kFullScale);
    EXPECT_EQ(d.rmse, 0);
    EXPECT_NEAR(d.ssim, 1, 1e-12);
    EXPECT_EQ(d.edges.rms_px, 0);
    EXPECT_GT(d.edges.count, 50U);
    ASSERT_EQ(d.bodies.size(), 1U);
    EXPECT_EQ(d.bodies[0].body, 3);
    EXPECT_EQ(d.bodies[0].x_px, 0);
}

TEST(ImageCompare, FindsByHowMuchABodyHasMoved) {
    for (const double shift : {0.01, 0.05, -0.2}) {
        const ImageDifference d =
            compare(ball(31 + shift, 31 - 0.5 * shift), ball(31, 31), body_of_ball(), kFullScale);
        ASSERT_EQ(d.bodies.size(), 1U);
        EXPECT_NEAR(d.bodies[0].x_px, shift, 0.02 * std::abs(shift));
        EXPECT_NEAR(d.bodies[0].y_px, -0.5 * shift, 0.02 * std::abs(shift));
        // Around a circle the outline moves by the shift's part along its normal: on the mean square by half of it.
        const double expected = std::abs(shift) * std::sqrt((1 + 0.25) / 2);
        EXPECT_NEAR(d.edges.rms_px, expected, 0.1 * expected);
        EXPECT_NEAR(d.edges.mean_px, 0, 0.05 * std::abs(shift));
    }
}

TEST(ImageCompare, ABallThatHasGrownMovesItsEdgesOutwards) {
    RadianceImage grown(kSize, kSize);
    for (int row = 0; row < kSize; ++row)
        for (int column = 0; column < kSize; ++column) {
            const double beyond = std::hypot(column - 31, row - 31) - 12.1;
            const auto light = static_cast<float>(0.5 * std::erfc(beyond / 1.2)) * 1.5f;
            grown.pixels[static_cast<std::size_t>(row * kSize + column)] = {light, light, light};
        }
    const ImageDifference d = compare(grown, ball(31, 31), body_of_ball(), kFullScale);
    EXPECT_NEAR(d.edges.mean_px, -0.1, 0.01);  // the gradient points to the light
    EXPECT_NEAR(d.bodies[0].x_px, 0, 1e-3);
}

TEST(ImageCompare, SimilarityOfEvenPicturesIsThatOfTheirLevels) {
    const auto even = [](float level) {
        RadianceImage image(kSize, kSize);
        std::fill(image.pixels.begin(), image.pixels.end(), Rgb{level, level, level});
        return image;
    };
    const std::vector<std::int32_t> nothing(kSize * kSize, -1);
    const ImageDifference d = compare(even(0.8f), even(1.0f), nothing, kFullScale);
    const double a = 0.4, b = 0.5, c1 = 1e-4;  // of the full scale
    EXPECT_NEAR(d.ssim, (2 * a * b + c1) / (a * a + b * b + c1), 1e-6);
    EXPECT_NEAR(d.rmse, 0.2, 1e-6);
    EXPECT_NEAR(d.bias, -0.2, 1e-6);
    EXPECT_EQ(d.edges.count, 0U);
    EXPECT_TRUE(d.bodies.empty());
}

TEST(ImageCompare, NoiseCostsSimilarityAndNoPlaces) {
    std::mt19937 random(5);
    std::normal_distribution<float> noise(0, 0.02f);
    RadianceImage noisy = ball(31, 31);
    for (Rgb& pixel : noisy.pixels) {
        const float n = noise(random);
        pixel += Rgb{n, n, n};
    }
    const ImageDifference d = compare(noisy, ball(31, 31), body_of_ball(), kFullScale);
    EXPECT_NEAR(d.rmse, 0.02, 0.001);  // of 4096 pixels: 1.1 % each standard deviation
    EXPECT_LT(d.ssim, 0.995);
    EXPECT_LT(std::abs(d.edges.mean_px), 0.01);
    EXPECT_LT(std::abs(d.bodies[0].x_px), 0.05);
}

TEST(ImageCompare, ABodyThatTheBorderCutsHasNoCentre) {
    std::vector<std::int32_t> body(kSize * kSize, -1);
    for (std::size_t i = 0; i < 10; ++i) body[i] = 0;
    EXPECT_TRUE(compare(ball(31, 31), ball(31, 31), body, kFullScale).bodies.empty());
}

}  // namespace
}  // namespace narpa::test
