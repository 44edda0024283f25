#include <gtest/gtest.h>

#include <cmath>

#include "renderer/assets/images/texture_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/image_files.h"

namespace narpa {
namespace {

using test::MemoryFolder;

/// IEC 61966-2-1, its own decimals.
double srgb_to_linear(double s) {
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

TEST(TextureFile, EightBitsAreMadeLinear) {
    const MemoryFolder folder;
    cv::Mat image(1, 256, CV_8UC3);
    for (int i = 0; i < 256; ++i)
        image.at<cv::Vec3b>(0, i) = cv::Vec3b(0, static_cast<uchar>(255 - i), static_cast<uchar>(i));
    test::write_image_file(folder / "t.png", image);
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

TEST(TextureFile, EveryEightBitCodeIsWithinHalfACodeOfTheStandard) {
    // Points of IEC 61966-2-1 worked out by hand: the end of the straight part, the middle, the ends.
    EXPECT_NEAR(srgb_to_linear(10 / 255.0), 0.00303527, 1e-8);
    EXPECT_NEAR(srgb_to_linear(128 / 255.0), 0.21586050, 1e-8);
    const MemoryFolder folder;
    cv::Mat codes(16, 16, CV_8UC1);
    for (int i = 0; i < 256; ++i) codes.at<uchar>(i / 16, i % 16) = static_cast<uchar>(i);
    test::write_image_file(folder / "t.png", codes);
    const Result<Texture> t = read_texture(folder / "t.png");
    ASSERT_TRUE(t);
    for (std::size_t i = 0; i < 256; ++i)
        for (std::size_t band = 0; band < 3; ++band)
            EXPECT_NEAR(t->rgb[3 * i + band], 65535 * srgb_to_linear(static_cast<double>(i) / 255), 0.5) << i;
    EXPECT_EQ(t->rgb.front(), 0);
    EXPECT_EQ(t->rgb.back(), 65535);
}

TEST(TextureFile, UseChoosesTheCurveWhateverTheDepth) {
    using Use = TextureUse;
    const MemoryFolder folder;
    cv::Mat eight(1, 256, CV_8UC1), sixteen(1, 256, CV_16UC1);
    for (int i = 0; i < 256; ++i) {
        eight.at<uchar>(0, i) = static_cast<uchar>(i);
        sixteen.at<std::uint16_t>(0, i) = static_cast<std::uint16_t>(257 * i);
    }
    test::write_image_file(folder / "8.png", eight);
    test::write_image_file(folder / "16.png", sixteen);
    const auto codes = [&](const char* file, Use::Colour colour) {
        const Result<Texture> t = read_texture(folder / file, {.colour = colour});
        EXPECT_TRUE(t);
        return t->rgb;
    };
    EXPECT_EQ(codes("8.png", Use::Colour::srgb), codes("8.png", Use::Colour::by_depth));
    EXPECT_EQ(codes("16.png", Use::Colour::linear), codes("16.png", Use::Colour::by_depth));
    EXPECT_EQ(codes("8.png", Use::Colour::linear), codes("16.png", Use::Colour::linear));
    EXPECT_EQ(codes("8.png", Use::Colour::srgb), codes("16.png", Use::Colour::srgb));
    EXPECT_NE(codes("8.png", Use::Colour::srgb), codes("8.png", Use::Colour::linear));
    EXPECT_EQ(codes("16.png", Use::Colour::normals), codes("16.png", Use::Colour::linear));
    EXPECT_EQ(codes("8.png", Use::Colour::linear)[3 * 100], 25700);
}

TEST(TextureFile, SixteenBitsOfSrgbAreMadeLinear) {
    const MemoryFolder folder;
    cv::Mat image(4, 1000, CV_16UC1);
    for (int i = 0; i < 4000; ++i) image.at<std::uint16_t>(i / 1000, i % 1000) = static_cast<std::uint16_t>(i * 16);
    test::write_image_file(folder / "t.png", image);
    const Result<Texture> t = read_texture(folder / "t.png", {.colour = TextureUse::Colour::srgb});
    ASSERT_TRUE(t);
    for (std::size_t i = 0; i < 4000; ++i)
        ASSERT_NEAR(t->rgb[3 * i], 65535 * srgb_to_linear(static_cast<double>(i * 16) / 65535), 0.5) << i;
}

TEST(TextureFile, EightAndSixteenBitsOfTheSamePictureAgreeWithinHalfACode) {
    // Linear light in 16 bits, and its sRGB in 8 bits: the 8-bit code is the nearest one.
    const MemoryFolder folder;
    cv::Mat sixteen(1, 4096, CV_16UC1), eight(1, 4096, CV_8UC1);
    const auto srgb = [](double l) { return l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055; };
    for (int i = 0; i < 4096; ++i) {
        sixteen.at<std::uint16_t>(0, i) = static_cast<std::uint16_t>(16 * i);
        eight.at<uchar>(0, i) = static_cast<uchar>(std::lround(255 * srgb(16 * i / 65535.0)));
    }
    test::write_image_file(folder / "16.png", sixteen);
    test::write_image_file(folder / "8.png", eight);
    const Result<Texture> a = read_texture(folder / "16.png"), b = read_texture(folder / "8.png");
    ASSERT_TRUE(a && b);
    for (std::size_t i = 0; i < 4096; ++i)  // rounding to 16 bits: a half more of a code of 65535
        ASSERT_NEAR(255 * srgb(a->rgb[3 * i] / 65535.0), 255 * srgb(b->rgb[3 * i] / 65535.0), 0.5 + 0.06) << i;
}

TEST(TextureFile, NormalMapsOfEightBitsAreFlatAt128) {
    const MemoryFolder folder;
    test::write_image_file(folder / "n.png", cv::Mat(1, 1, CV_8UC3, cv::Scalar(255, 128, 128)));
    test::write_image_file(folder / "ends.png", cv::Mat(1, 1, CV_8UC3, cv::Scalar(255, 64, 0)));
    const Result<Texture> n = read_texture(folder / "n.png", {.colour = TextureUse::Colour::normals});
    const Result<Texture> ends = read_texture(folder / "ends.png", {.colour = TextureUse::Colour::normals});
    ASSERT_TRUE(n && ends);
    EXPECT_EQ(n->rgb, (std::vector<std::uint16_t>{32768, 32768, 65535}));
    EXPECT_EQ(ends->rgb, (std::vector<std::uint16_t>{0, 16384, 65535}));
}

TEST(TextureFile, BringsItsCoarserLevelsAndItsWrap) {
    const MemoryFolder folder;
    cv::Mat image(2, 4, CV_16UC1, cv::Scalar(1000));
    image.at<std::uint16_t>(0, 0) = 3000;
    test::write_image_file(folder / "t.png", image);
    const Result<Texture> t = read_texture(folder / "t.png", {.wrap = Texture::Wrap::clamp});
    ASSERT_TRUE(t);
    EXPECT_EQ(t->wrap, Texture::Wrap::clamp);
    ASSERT_EQ(t->coarser.size(), 2u);
    EXPECT_EQ(t->coarser[0].rgb, (std::vector<std::uint16_t>{1500, 1500, 1500, 1000, 1000, 1000}));
    EXPECT_EQ(t->coarser[1].rgb, (std::vector<std::uint16_t>{1250, 1250, 1250}));
    EXPECT_EQ(read_texture(folder / "t.png")->wrap, Texture::Wrap::repeat);
}

TEST(TextureFile, SixteenBitsAreLinearAlready) {
    const MemoryFolder folder;
    const cv::Mat image(2, 3, CV_16UC3, cv::Scalar(300, 200, 100));
    test::write_image_file(folder / "t.png", image);
    const Result<Texture> t = read_texture(folder / "t.png");
    ASSERT_TRUE(t) << t.error().text();
    EXPECT_EQ(t->rgb.size(), 18u);
    EXPECT_EQ((std::array{t->rgb[0], t->rgb[1], t->rgb[2]}), (std::array<std::uint16_t, 3>{100, 200, 300}));
}

TEST(TextureFile, GreyIsCopiedAndAlphaDropped) {
    const MemoryFolder folder;
    test::write_image_file(folder / "grey.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(255)));
    test::write_image_file(folder / "alpha.png", cv::Mat(1, 1, CV_8UC4, cv::Scalar(255, 0, 255, 0)));
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
    const MemoryFolder folder;
    test::write_image_file(folder / "cut.png", cv::Mat(64, 64, CV_8UC3, cv::Scalar(1, 2, 3)));
    std::filesystem::resize_file(folder / "cut.png", 40);
    for (const std::string& path : {folder.write("text.png", "not an image"), folder.write("empty.png", ""),
                                    folder / "missing.png", folder / "cut.png", folder / "."}) {
        const Result<Texture> t = read_texture(path);
        ASSERT_FALSE(t) << path;
        EXPECT_EQ(t.error().file, path);
        EXPECT_EQ(t.error().kind, ErrorKind::bad_input);
    }
}

TEST(TextureFile, FormatsOfTheManualAreRead) {
    const MemoryFolder folder;
    const cv::Mat image(31, 50, CV_8UC3, cv::Scalar(0, 0, 255));
    for (const char* name : {"t.png", "t.jpg", "t.tiff", "t.webp", "t.bmp", "t.ppm", "t.pgm", "t.pbm"}) {
        const bool is_grey = std::string(name) == "t.pgm" || std::string(name) == "t.pbm";
        test::write_image_file(folder / name, is_grey ? cv::Mat(31, 50, CV_8UC1, cv::Scalar(255)) : image);
        const Result<Texture> t = read_texture(folder / name);
        ASSERT_TRUE(t) << t.error().text();
        EXPECT_EQ(t->width, 50);
        EXPECT_EQ(t->height, 31);
        EXPECT_GT(t->rgb[0], 60'000) << name;
    }
}

TEST(TextureFile, AJpegThatIsCutShortIsRefused) {
    const MemoryFolder folder;
    cv::Mat noise(64, 64, CV_8UC3);
    cv::randu(noise, 0, 255);
    test::write_image_file(folder / "t.jpg", noise);
    const std::string whole = test::read_text(folder / "t.jpg");
    EXPECT_TRUE(read_texture(folder.write("more.jpg", whole + "\xFF\xDA trailer")));
    for (const std::size_t part : {whole.size() / 3, whole.size() - 2}) {
        const Result<Texture> cut = read_texture(folder.write("cut.jpg", whole.substr(0, part)));
        ASSERT_FALSE(cut);
        EXPECT_EQ(cut.error().what, "a JPEG without an end: it is cut short");
    }
}

TEST(TextureFile, OtherFormatsAndTooManyPixelsAreRefusedBeforeTheyAreDecoded) {
    const MemoryFolder folder;
    const auto error_of = [&](const std::string& path) {
        const Result<Texture> t = read_texture(path);
        return t ? "" : t.error().text().substr(path.size());
    };
    test::write_image_file(folder / "t.ras", cv::Mat(1, 1, CV_8UC3, cv::Scalar(1, 2, 3)));  // Sun raster
    EXPECT_EQ(error_of(folder / "t.ras"),
              ": has the format Sun raster, expected PNG, JPEG, TIFF, WebP, BMP, PNM or PAM");
    const std::string words = " pixels, expected at most 268435456 of them";
    EXPECT_EQ(error_of(folder.write("t.ppm", "P6 # comment 1 1\n20000 20000\n255\n")),
              ": an image of 20000 x 20000" + words);
    EXPECT_EQ(error_of(folder.write("u.ppm", "P6 99999999999999999999 1 255\n")),
              ": an image of 2147483648 x 1" + words);
    // A size written over that of a good file.
    const auto with_bytes = [&](const char* name, std::size_t at, const std::string& bytes) {
        test::write_image_file(folder / name, cv::Mat(2, 2, CV_8UC3, cv::Scalar(1, 2, 3)));
        std::string file = test::read_text(folder / name);
        return folder.write(name, file.replace(at, bytes.size(), bytes));
    };
    EXPECT_EQ(error_of(with_bytes("t.png", 16, std::string("\x00\x00\x80\x00\x00\x00\x80\x00", 8))),
              ": an image of 32768 x 32768" + words);
    EXPECT_EQ(error_of(with_bytes("t.bmp", 18, std::string("\x00\x80\x00\x00\x00\x80\xff\xff", 8))),
              ": an image of 32768 x 32768" + words);
    const std::string jpeg("\xff\xd8\xff\xe0\x00\x04??\xff\xc0\x00\x11\x08\x80\x00\x80\x01", 17);
    EXPECT_EQ(error_of(folder.write("t.jpg", jpeg + "\x03")), ": an image of 32769 x 32768" + words);
}

}  // namespace
}  // namespace narpa
