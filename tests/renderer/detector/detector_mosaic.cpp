// Bayer mosaics: each pixel takes the band of its place.
#include <gtest/gtest.h>

#include <map>

#include "tests/renderer/detector/detector_support.h"

namespace narpa {
namespace {

using namespace test;

const std::map<PixelFormat, std::string> kMosaics{{PixelFormat::rggb8, "RGGB"},  {PixelFormat::grbg8, "GRBG"},
                                                  {PixelFormat::gbrg8, "GBRG"},  {PixelFormat::bggr8, "BGGR"},
                                                  {PixelFormat::rggb16, "RGGB"}, {PixelFormat::grbg16, "GRBG"},
                                                  {PixelFormat::gbrg16, "GBRG"}, {PixelFormat::bggr16, "BGGR"}};

/// The band at (x, y), by the letters of the format's name.
std::size_t band_at(const std::string& letters, int x, int y) {
    return std::string("RGB").find(letters[static_cast<std::size_t>(2 * (y % 2) + x % 2)]);
}
int sample(const std::vector<std::uint8_t>& bytes, PixelFormat format, std::size_t i) {
    return is_16_bit(format) ? bytes[2 * i] | bytes[2 * i + 1] << 8 : bytes[i];
}

/// Widths below, at and beyond a batch of sixteen; several tasks.
class MosaicSize : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(MosaicSize, EqualsTheBandsOfRgbAtItsPlacesWithoutNoise) {
    const auto [width, height] = GetParam();
    const RadianceImage image = motley(width, height);
    for (const bool ideal : {true, false})
        for (const auto& [format, letters] : kMosaics) {
            Camera c = sensor(width, height, PixelFormat::rgb24);
            c.detector->bits = 8;
            c.white_radiance = 300;
            if (ideal) c.detector.reset();
            const std::vector<std::uint8_t> rgb = bytes_of(c, image);
            c.format = format;
            const std::vector<std::uint8_t> mosaic = bytes_of(c, image);
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < width; ++x) {
                    const auto i = static_cast<std::size_t>(y * width + x);
                    const int expected = rgb[3 * i + band_at(letters, x, y)], got = sample(mosaic, format, i);
                    if (!is_16_bit(format))
                        ASSERT_EQ(got, expected) << letters << ideal << " at " << x << ", " << y;
                    else if (!ideal)
                        ASSERT_EQ(got, expected << 8) << letters << " at " << x << ", " << y;
                    else  // finer steps of the same value
                        ASSERT_NEAR(got / 257.0, expected, 0.502) << letters << " at " << x << ", " << y;
                }
        }
}
INSTANTIATE_TEST_SUITE_P(Sizes, MosaicSize,
                         testing::Values(std::pair{2, 2}, std::pair{6, 8}, std::pair{14, 4}, std::pair{16, 6},
                                         std::pair{18, 10}, std::pair{322, 260}),
                         [](const auto& instance) {
                             return std::to_string(instance.param.first) + "x" +
                                    std::to_string(instance.param.second);
                         });

TEST(Mosaic, NoiseIsThatOfAMonochromePixelOfTheSameMean) {
    const int width = 210, height = 54;
    const RadianceImage image = motley(width, height);
    for (const auto& [format, letters] : kMosaics) {
        if (!is_16_bit(format)) continue;
        // All light of a pixel's own band, and none of the others.
        RadianceImage own(width, height);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const auto i = static_cast<std::size_t>(y * width + x);
                const int band = static_cast<int>(band_at(letters, x, y));
                own.pixels[i][band] = image.pixels[i][band];
            }
        EXPECT_EQ(bytes_of(noisy_camera(width, height, format), image),
                  bytes_of(noisy_camera(width, height, PixelFormat::y16), own))
            << letters;
    }
}

TEST(Mosaic, ExposesTheWidestImage) {
    // Rows are found by a product with 1 / width: at the far end of a large image too.
    const int width = 16384, height = 64;
    RadianceImage image(width, height);
    for (Rgb& p : image.pixels) p = {100, 200, 50};
    Camera c = camera(width, height, 100);
    c.white_radiance = 255;
    c.format = PixelFormat::gbrg8;
    const std::vector<std::uint8_t> bytes = bytes_of(c, image);
    const int expected[] = {100, 200, 50};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            ASSERT_EQ(bytes[static_cast<std::size_t>(y * width + x)], expected[band_at("GBRG", x, y)])
                << x << ", " << y;
}

}  // namespace
}  // namespace narpa
