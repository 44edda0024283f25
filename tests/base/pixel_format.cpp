#include "base/pixel_format.h"

#include <gtest/gtest.h>

namespace narpa {
namespace {

TEST(PixelFormat, NamesGoThereAndBack) {
    for (std::size_t i = 0; i < kPixelFormatNames.size(); ++i) {
        const auto f = static_cast<PixelFormat>(i);
        EXPECT_EQ(pixel_format_from(name(f)), f) << name(f);
    }
    EXPECT_EQ(name(PixelFormat::bggr16), "BGGR16");
    EXPECT_FALSE(pixel_format_from("grey")) << "V4L2's names are in capitals";
    EXPECT_FALSE(pixel_format_from(""));
}

TEST(PixelFormat, FrameBytesAreThoseOfV4l2) {
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::grey}), 307200u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::y16}), 614400u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::yuyv}), 614400u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::rgb24}), 921600u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::grbg8}), 307200u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::bggr16}), 614400u);
    EXPECT_EQ(frame_bytes({.width = 65536, .height = 65536, .pixel = PixelFormat::rgb24}), 12884901888u);
}

TEST(PixelFormat, BandsOfAMosaicAreThoseOfItsName) {
    EXPECT_EQ(bayer_band(PixelFormat::rggb8, 0, 0), 0u);
    EXPECT_EQ(bayer_band(PixelFormat::rggb8, 5, 2), 1u);
    EXPECT_EQ(bayer_band(PixelFormat::rggb16, 5, 3), 2u);
    EXPECT_EQ(bayer_band(PixelFormat::gbrg16, 1, 0), 2u);
    EXPECT_EQ(bayer_band(PixelFormat::gbrg16, 0, 1), 0u);
}

TEST(PixelFormat, FramesOfOddSizesAreNamed) {
    EXPECT_EQ(unfit_size(PixelFormat::grey, 3, 5), "");
    EXPECT_EQ(unfit_size(PixelFormat::yuyv, 2, 5), "");
    EXPECT_EQ(unfit_size(PixelFormat::yuyv, 3, 4), "YUYV needs an even width, not 3");
    EXPECT_EQ(unfit_size(PixelFormat::bggr8, 3, 5), "BGGR8 needs an even width, not 3");
    EXPECT_EQ(unfit_size(PixelFormat::bggr8, 4, 5), "BGGR8 needs an even height, not 5");
}

}  // namespace
}  // namespace narpa
