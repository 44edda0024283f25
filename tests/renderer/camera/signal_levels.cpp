// How a frame's light fits the camera's scale, against the bytes of the frame itself.
#include "renderer/camera/signal_levels.h"

#include <gtest/gtest.h>

#include "renderer/detector/dark_current.h"
#include "tests/renderer/detector/detector_support.h"

namespace narpa::test {
namespace {

constexpr std::array kFormats{PixelFormat::grey, PixelFormat::y16,   PixelFormat::rgb24,
                              PixelFormat::yuyv, PixelFormat::rggb8, PixelFormat::bggr16};

RadianceImage even(const Camera& c, float radiance) {
    RadianceImage image(c.width, c.height);
    std::ranges::fill(image.pixels, Rgb{radiance, radiance, radiance});
    return image;
}

/// A camera without noise whose scale has more than one kind of end.
Camera camera_of(PixelFormat format, double gain_e_per_dn) {
    Camera c = sensor(32, 16, format);
    c.detector->bits = 12;
    c.detector->black_level_dn = 40;
    c.detector->gain_e_per_dn = gain_e_per_dn;
    return c;
}

TEST(SignalLevels, OfAnEvenImageAreItsRadiance) {
    for (const PixelFormat format : kFormats) {
        Camera c = camera(32, 16, 100);
        c.format = format;
        c.white_radiance = 40;
        const SignalLevels half = signal_levels(c, even(c, 20));
        EXPECT_NEAR(half.bright, 0.5, 1e-6) << name(format);
        EXPECT_NEAR(half.brightest, 0.5, 1e-6);
        EXPECT_EQ(half.lit_share, 1);
        EXPECT_EQ(half.saturated_share, 0);
        EXPECT_FALSE(half.is_black() || half.is_overexposed());
        EXPECT_EQ(signal_levels(c, even(c, 41)).saturated_share, 1);
        EXPECT_TRUE(signal_levels(c, even(c, 41)).is_overexposed());
        EXPECT_TRUE(signal_levels(c, even(c, 0)).is_black());
    }
}

TEST(SignalLevels, FullScaleIsWhereTheBytesStop) {
    for (const PixelFormat format : kFormats)
        for (const double gain :
             {0.0, 1.0, 9.0}) {  // the well and the converter end together, or one before the other
            const Camera c = camera_of(format, gain);
            const double scale = 1 / signal_levels(c, even(c, 1)).brightest;
            const auto at = [&](double level) { return bytes_of(c, even(c, static_cast<float>(level * scale))); };
            if (is_mono(format)) {  // else other bands have less
                EXPECT_EQ(at(1.001), at(3)) << name(format) << ", gain " << gain;
            }
            EXPECT_NE(at(0.95), at(3)) << name(format) << ", gain " << gain;
        }
}

TEST(SignalLevels, BlackIsWhatTheBytesDoNotTellFromNoLight) {
    for (const PixelFormat format : {PixelFormat::grey, PixelFormat::y16})
        for (const double gain : {0.0, 1.0, 9.0}) {
            const Camera c = camera_of(format, gain);
            const double scale = 1 / signal_levels(c, even(c, 1)).brightest;
            const double step = signal_levels(c, even(c, 1)).darkest_step;
            const auto at = [&](double level) { return even(c, static_cast<float>(level * scale)); };
            EXPECT_TRUE(signal_levels(c, at(0.99 * step)).is_black());
            EXPECT_FALSE(signal_levels(c, at(1.01 * step)).is_black());
            EXPECT_EQ(bytes_of(c, at(0.99 * step)), bytes_of(c, at(0))) << name(format) << ", gain " << gain;
            EXPECT_NE(bytes_of(c, at(1.01 * step)), bytes_of(c, at(0))) << name(format) << ", gain " << gain;
        }
}

TEST(SignalLevels, CountOnlyPixelsWithLight) {
    Camera c = camera(100, 100, 100);
    c.white_radiance = 1;
    RadianceImage image(100, 100);
    const auto fill = [&](std::size_t count, float radiance) {
        std::fill_n(image.pixels.begin(), count, Rgb{radiance, radiance, radiance});
    };
    fill(400, 0.5f);
    fill(5, 40);
    SignalLevels levels = signal_levels(c, image);
    EXPECT_NEAR(levels.lit_share, 0.04, 1e-12);
    EXPECT_NEAR(levels.saturated_share, 0.0005, 1e-12);
    EXPECT_FALSE(levels.is_overexposed()) << "a few stars";
    fill(39, 40);
    EXPECT_FALSE(signal_levels(c, image).is_overexposed()) << "glints on a body";
    fill(41, 40);
    levels = signal_levels(c, image);
    EXPECT_TRUE(levels.is_overexposed());
    EXPECT_FLOAT_EQ(static_cast<float>(levels.bright), 40);
    fill(400, 0);
    fill(50, 2);
    EXPECT_TRUE(signal_levels(c, image).is_overexposed()) << "all of a small body";
}

TEST(SignalLevels, DarkCurrentSaturatesToo) {
    Camera c = camera_of(PixelFormat::y16, 0);
    const double dark_e_s = 0.4 * c.detector->full_well_e / c.detector->exposure_s;
    c.detector->stages = {dark_current(dark_e_s)};
    const double scale = 1 / signal_levels(c, even(c, 1)).brightest;
    const auto levels = [&](double level) { return signal_levels(c, even(c, static_cast<float>(level * scale))); };
    EXPECT_NEAR(levels(0).dark, 0.4, 1e-12);
    EXPECT_EQ(levels(0.55).saturated_share, 0);
    EXPECT_EQ(levels(0.65).saturated_share, 1);
    EXPECT_FALSE(levels(0.1).is_filled_by_dark_current());
    c.detector->stages = {dark_current(2 * dark_e_s)};
    EXPECT_TRUE(levels(0).is_filled_by_dark_current());
}

TEST(SignalLevels, OfNoNumbersAreNone) {
    const Camera c = camera_of(PixelFormat::grey, 0);
    const SignalLevels levels = signal_levels(c, even(c, std::numeric_limits<float>::quiet_NaN()));
    EXPECT_EQ(levels.brightest, 0);
    EXPECT_EQ(levels.saturated_share, 0);
}

}  // namespace
}  // namespace narpa::test
