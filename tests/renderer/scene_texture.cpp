#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "renderer/scene/texture_file.h"
#include "tests/renderer/scene_support.h"

namespace narpa {
namespace {

using test::TemporaryFolder;

/// IEC 61966-2-1, its own decimals.
double srgb_to_linear(double s) {
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

TEST(TextureFile, EightBitsAreMadeLinear) {
    const TemporaryFolder folder;
    cv::Mat image(1, 256, CV_8UC3);
    for (int i = 0; i < 256; ++i)
        image.at<cv::Vec3b>(0, i) = cv::Vec3b(0, static_cast<uchar>(255 - i), static_cast<uchar>(i));
    cv::imwrite(folder / "t.png", image);
    const Result<Texture> t = read_texture(folder / "t.png");
    ASSERT_TRUE(t) << t.error().text();
    ASSERT_EQ(t->width, 256);
    ASSERT_EQ(t->height, 1);
    for (std::size_t i = 0; i < 256; ++i) {
        EXPECT_NEAR(t->rgb[3 * i], 65535 * srgb_to_linear(static_cast<double>(i) / 255), 0.5) << "red " << i;
        EXPECT_NEAR(t->rgb[3 * i + 1], 65535 * srgb_to_linear(static_cast<double>(255 - i) / 255), 0.5)
            << "green " << i;
        EXPECT_EQ(t->rgb[3 * i + 2], 0) << "blue";
    }
}

TEST(TextureFile, SixteenBitsAreLinearAlready) {
    const TemporaryFolder folder;
    const cv::Mat image(2, 3, CV_16UC3, cv::Scalar(300, 200, 100));
    cv::imwrite(folder / "t.png", image);
    const Result<Texture> t = read_texture(folder / "t.png");
    ASSERT_TRUE(t) << t.error().text();
    EXPECT_EQ(t->rgb.size(), 18u);
    EXPECT_EQ((std::array{t->rgb[0], t->rgb[1], t->rgb[2]}), (std::array<std::uint16_t, 3>{100, 200, 300}));
}

TEST(TextureFile, GreyIsCopiedAndAlphaDropped) {
    const TemporaryFolder folder;
    cv::imwrite(folder / "grey.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(255)));
    cv::imwrite(folder / "alpha.png", cv::Mat(1, 1, CV_8UC4, cv::Scalar(255, 0, 255, 0)));
    const Result<Texture> grey = read_texture(folder / "grey.png"), alpha = read_texture(folder / "alpha.png");
    ASSERT_TRUE(grey && alpha);
    EXPECT_EQ(grey->rgb, (std::vector<std::uint16_t>{65535, 65535, 65535}));
    EXPECT_EQ(alpha->rgb, (std::vector<std::uint16_t>{65535, 0, 65535}));
}

TEST(TextureFile, RowsComeFromTheTop) {
    const Result<Texture> t = read_texture(test::data_file("checker.ppm"));
    ASSERT_TRUE(t) << t.error().text();
    EXPECT_EQ(t->rgb[0], 65535);
    EXPECT_EQ(t->rgb[3], 0);
    EXPECT_NEAR(t->rgb[6], 65535 * srgb_to_linear(188.0 / 255), 0.5);
    EXPECT_EQ(t->rgb[7], 0);
}

TEST(TextureFile, WhatIsNoImageGivesAnError) {
    const TemporaryFolder folder;
    cv::imwrite(folder / "cut.png", cv::Mat(64, 64, CV_8UC3, cv::Scalar(1, 2, 3)));
    std::filesystem::resize_file(folder / "cut.png", 40);
    for (const std::string& path : {folder.write("text.png", "not an image"), folder.write("empty.png", ""),
                                    folder / "missing.png", folder / "cut.png", folder / "."}) {
        const Result<Texture> t = read_texture(path);
        ASSERT_FALSE(t) << path;
        EXPECT_EQ(t.error().file, path);
        EXPECT_EQ(t.error().kind, ErrorKind::bad_input);
    }
}

}  // namespace
}  // namespace narpa
