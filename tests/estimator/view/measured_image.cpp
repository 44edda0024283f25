// What the estimator takes a frame to be, against the detector that made it.
#include "estimator/view/measured_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "renderer/detector/dark_current.h"
#include "renderer/detector/detector.h"
#include "renderer/detector/nonuniformity.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

constexpr int kWidth_px = 128, kHeight_px = 96;

Camera camera_with(PixelFormat format, bool detector) {
    Camera c;
    c.width = kWidth_px, c.height = kHeight_px;
    test::set_pinhole(c, 200, 200, 63.5, 47.5);
    c.format = format;
    c.white_radiance = 250;
    if (detector) {
        Detector d;
        d.exposure_s = 2e-5;
        d.read_noise_e = 60;  // enough to dither a step of eight bits
        d.shot_noise = true;
        d.black_level_dn = 64;
        d.bits = 12;
        c.detector = d;
    }
    return c;
}

MeasuredImage frame_of(const Camera& camera, const Rgb& radiance) {
    RadianceImage light(camera.width, camera.height);
    std::fill(light.pixels.begin(), light.pixels.end(), radiance);
    std::vector<std::uint8_t> bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    expose(camera, light, 5, 3, bytes);
    auto image = measured_image(camera, bytes);
    EXPECT_TRUE(image);
    return image ? *image : MeasuredImage{};
}

struct Moments {
    double mean = 0, variance = 0;
};
Moments moments(const MeasuredImage& image) {
    Moments m;
    for (const float v : image.dn) m.mean += v;
    m.mean /= static_cast<double>(image.dn.size());
    for (const float v : image.dn) m.variance += (v - m.mean) * (v - m.mean);
    m.variance /= static_cast<double>(image.dn.size() - 1);
    return m;
}

class EveryFormat : public testing::TestWithParam<PixelFormat> {};

TEST_P(EveryFormat, MeanAndVarianceAreTheDetectors) {
    const Camera camera = camera_with(GetParam(), true);
    const SensorModel model = sensor_model(camera);
    for (const float level : {20.f, 60.f, 120.f}) {
        const Rgb light{level, level, level};
        const Moments seen = moments(frame_of(camera, light));
        const double expected = model.dn(light), variance = model.variance_dn2(expected);
        constexpr double kPixels = kWidth_px * kHeight_px;
        // Truncation to eight bits is in the variance, and may shift the mean by a fraction of its step.
        EXPECT_NEAR(seen.mean, expected,
                    5 * std::sqrt(variance / kPixels) + 0.1 * std::sqrt(12 * model.rounding_dn2))
            << level;
        if (GetParam() == PixelFormat::yuyv) continue;  // its luma is rounded twice
        if (is_bayer(GetParam())) {                     // means of 3 x 3: 36 / 256 of the variance, and correlated
            EXPECT_NEAR(seen.variance / variance, 36.0 / 256, 0.03) << level;
            continue;
        }
        EXPECT_NEAR(seen.variance / variance, 1, 0.12) << level;
    }
}
INSTANTIATE_TEST_SUITE_P(Formats, EveryFormat,
                         testing::Values(PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv, PixelFormat::rgb24,
                                         PixelFormat::gbrg8, PixelFormat::rggb16));

/// Of an uneven image in colour: what a frame without noise reads, within the rounding of its numbers. A mosaic's
/// means are of neighbours.
TEST_P(EveryFormat, ExpectedSignalIsThatOfAFrameWithoutNoise) {
    Camera camera = camera_with(GetParam(), true);
    camera.detector->read_noise_e = 0, camera.detector->shot_noise = false;
    camera.embedded_line = true;
    RadianceImage light(camera.width, camera.height);
    for (int y = 0; y < kHeight_px; ++y)
        for (int x = 0; x < kWidth_px; ++x)
            light.pixels[static_cast<std::size_t>(y * kWidth_px + x)] = {
                static_cast<float>(20 + 15 * std::sin(x)), static_cast<float>(30 + 10 * std::cos(y)),
                static_cast<float>(25 + 20 * std::sin(x + 2 * y))};
    std::vector<std::uint8_t> bytes(frame_bytes({kWidth_px, kHeight_px, camera.format, camera.period_ns}));
    expose(camera, light, 5, 3, bytes);
    const auto frame = measured_image(camera, bytes);
    ASSERT_TRUE(frame);
    const SensorModel sensor = sensor_model(camera);
    const std::vector<float> expected = expected_signal(camera, light);
    ASSERT_EQ(expected.size(), frame->dn.size());
    const double step = std::sqrt(12 * sensor.rounding_dn2);
    double largest = 0;
    for (std::size_t i = 0; i < expected.size(); ++i)
        largest = std::max(largest, std::abs(static_cast<double>(frame->dn[i]) - sensor.black_dn -
                                             static_cast<double>(expected[i])));
    EXPECT_LE(largest, 1.5 * step + 1) << name(GetParam());
}

TEST(MeasuredImage, NoiseModelHasDarkCurrentPrnuAndDsnu) {
    Camera camera = camera_with(PixelFormat::y16, true);
    camera.detector->stages = {dark_current(4e8), nonuniformity({.prnu = 0.03, .dsnu_e = 80})};  // 8000 e-
    const SensorModel model = sensor_model(camera);
    for (const float level : {0.f, 60.f, 120.f}) {
        const Rgb light{level, level, level};
        const Moments seen = moments(frame_of(camera, light));
        const double expected = model.dn(light), variance = model.variance_dn2(expected);
        EXPECT_NEAR(seen.mean, expected, 5 * std::sqrt(variance / (kWidth_px * kHeight_px))) << level;
        EXPECT_NEAR(seen.variance / variance, 1, 5 * std::sqrt(2.0 / (kWidth_px * kHeight_px))) << level;
    }
}

TEST(MeasuredImage, MosaicsOfEvenLightAreEven) {
    for (const PixelFormat format :
         {PixelFormat::rggb16, PixelFormat::grbg16, PixelFormat::gbrg16, PixelFormat::bggr16})
        for (const bool embedded_line : {false, true}) {
            Camera camera = camera_with(format, false);
            camera.embedded_line = embedded_line;
            const MeasuredImage image = frame_of(camera, {50, 100, 200});
            const double expected = sensor_model(camera).dn({50, 100, 200});
            for (const float dn : image.dn) ASSERT_NEAR(dn, expected, 1);
        }
}

TEST(MeasuredImage, IdealSensorsAreLinearUpToWhite) {
    const Camera camera = camera_with(PixelFormat::y16, false);
    const SensorModel model = sensor_model(camera);
    EXPECT_NEAR(model.dn({125, 125, 125}), 32767.5, 0.5);
    EXPECT_EQ(model.dn({600, 600, 600}), 65535);
    EXPECT_NEAR(moments(frame_of(camera, {125, 125, 125})).mean, 32767.5, 1);
}

TEST(MeasuredImage, LeavesTheEmbeddedLineOut) {
    Camera camera = camera_with(PixelFormat::grey, false);
    camera.embedded_line = true;
    EXPECT_EQ(frame_of(camera, {1, 1, 1}).height, kHeight_px - 1);
}

TEST(MeasuredImage, RefusesOtherSizes) {
    const std::vector<std::uint8_t> bytes(100);
    const auto image = measured_image(camera_with(PixelFormat::y16, false), bytes);
    ASSERT_FALSE(image);
    EXPECT_NE(image.error().what.find("expected 24576"), std::string::npos) << image.error().what;
}

TEST(CoarserCamera, SeesTheSameDirections) {
    const Camera fine = camera_with(PixelFormat::grey, false), coarse = coarser_camera(fine, 4);
    EXPECT_EQ(coarse.width, 32);
    // The coarse pixel (3, 5) covers the fine ones 12..15 and 20..23; its middle is theirs.
    const Vec3 by_coarse = coarse.model->on_plane({3, 5}), by_fine = fine.model->on_plane({13.5, 21.5});
    EXPECT_NEAR(by_coarse.x, by_fine.x, 1e-15);
    EXPECT_NEAR(by_coarse.y, by_fine.y, 1e-15);
}

TEST(CoarserImage, TakesMeans) {
    MeasuredImage image{5, 4, {}};
    for (int i = 0; i < 20; ++i) image.dn.push_back(static_cast<float>(i));
    const MeasuredImage half = coarser_image(image, 2);
    EXPECT_EQ(half.width, 2);
    EXPECT_EQ(half.height, 2);
    EXPECT_EQ(half.at(0, 0), 3);   // of 0, 1, 5, 6
    EXPECT_EQ(half.at(1, 1), 15);  // of 12, 13, 17, 18
}

}  // namespace
}  // namespace narpa
