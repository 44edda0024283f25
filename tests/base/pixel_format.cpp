#include "base/pixel_format.h"

#include <gtest/gtest.h>

namespace narpa {
namespace {

TEST(PixelFormat, NamesGoThereAndBack) {
    for (const PixelFormat f : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv, PixelFormat::rgb24})
        EXPECT_EQ(pixel_format_from(name(f)), f) << name(f);
    EXPECT_FALSE(pixel_format_from("grey")) << "V4L2's names are in capitals";
    EXPECT_FALSE(pixel_format_from(""));
}

TEST(PixelFormat, FrameBytesAreThoseOfV4l2) {
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::grey}), 307200u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::y16}), 614400u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::yuyv}), 614400u);
    EXPECT_EQ(frame_bytes({.width = 640, .height = 480, .pixel = PixelFormat::rgb24}), 921600u);
    EXPECT_EQ(frame_bytes({.width = 65536, .height = 65536, .pixel = PixelFormat::rgb24}), 12884901888u);
}

}  // namespace
}  // namespace narpa
