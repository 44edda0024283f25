/// tests/renderer/detector/detector_support.h - cameras with a detector, what they look at, and the numbers of
/// their frames.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "renderer/detector/detector.h"
#include "tests/renderer/detector/detector_philox.h"
#include "tests/support/shapes.h"

namespace narpa::test {

inline Camera noisy_camera(int width, int height, PixelFormat format) {
    Camera c = camera(width, height, 100);
    c.format = format;
    c.detector = Detector{};
    c.detector->shot_noise = true;
    c.detector->read_noise_e = 6;
    c.detector->black_level_dn = 40;
    return c;
}
/// Black sky, faint and bright pixels side by side, and what no radiance should be.
inline RadianceImage motley(int width, int height) {
    RadianceImage image(width, height);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const Block w = philox({static_cast<std::uint32_t>(i), 0, 0, 0}, {5, 5});
        const auto level = [&](std::uint32_t word) {
            return w[3] % 3 == 0 ? 0.0f : std::exp2(static_cast<float>(word >> 8) * 0x1p-24f * 18 - 8);
        };
        image.pixels[i] = {level(w[0]), level(w[1]), level(w[2])};
    }
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    if (image.pixels.size() > 20) {
        image.pixels[1] = {nan, 30, -infinity};
        image.pixels[2] = {infinity, -0.0f, 1};
        image.pixels[17] = {-1, 1e30f, 1e-40f};
    }
    return image;
}
inline std::vector<std::uint8_t> bytes_of(const Camera& c, const RadianceImage& image) {
    std::vector<std::uint8_t> out(frame_bytes({image.width, image.height, c.format, 0}));
    expose(c, image, 3, 8, out);
    return out;
}

inline Camera sensor(int width, int height, PixelFormat format) {
    Camera c = camera(width, height, 100);
    c.format = format;
    c.detector = Detector{};
    return c;
}
inline std::vector<std::uint8_t> bytes_of(const Camera& c, const Rgb& radiance, std::uint64_t seed = 0,
                                          std::uint32_t frame = 0) {
    RadianceImage image(c.width, c.height);
    std::fill(image.pixels.begin(), image.pixels.end(), radiance);
    std::vector<std::uint8_t> out(frame_bytes({c.width, c.height, c.format, 0}));
    expose(c, image, seed, frame, out);
    return out;
}
/// The ADC's numbers of a Y16 frame.
inline std::vector<int> dn_of(const Camera& c, const Rgb& radiance, std::uint64_t seed = 0,
                              std::uint32_t frame = 0) {
    const auto bytes = bytes_of(c, radiance, seed, frame);
    std::vector<int> dn(bytes.size() / 2);
    for (std::size_t i = 0; i < dn.size(); ++i)
        dn[i] = (bytes[2 * i] | (bytes[2 * i + 1] << 8)) >> (16 - c.detector->bits);
    return dn;
}
struct Moments {
    double mean, variance;
};
inline Moments moments(const std::vector<int>& v) {
    const double n = static_cast<double>(v.size());
    const double mean = std::accumulate(v.begin(), v.end(), 0.0) / n;
    double squares = 0;
    for (const int x : v) squares += (x - mean) * (x - mean);
    return {mean, squares / (n - 1)};
}
/// The even grey radiance that collects this many electrons in a monochrome pixel.
inline Rgb radiance_for(const Detector& d, double electrons) {
    const double k = electrons_per_radiance(d, 0) + electrons_per_radiance(d, 1) + electrons_per_radiance(d, 2);
    const float l = static_cast<float>(electrons / k);
    return {l, l, l};
}

/// One electron a DN, 16 bits, no noise; the black level leaves room for offsets below it.
inline Camera counting(int width, int height) {
    Camera c = sensor(width, height, PixelFormat::y16);
    c.name = "counting";
    c.detector->bits = 16;
    c.detector->black_level_dn = 100;
    c.detector->gain_e_per_dn = 1;
    c.detector->full_well_e = 60000;
    return c;
}
/// Electrons above black of each pixel.
inline std::vector<int> electrons(const Camera& c, const RadianceImage& image, std::uint32_t frame = 0) {
    std::vector<std::uint8_t> bytes(frame_bytes({c.width, c.height, c.format, 0}));
    expose(c, image, 1, frame, bytes);
    std::vector<int> e(bytes.size() / 2);
    for (std::size_t i = 0; i < e.size(); ++i)
        e[i] = (bytes[2 * i] | bytes[2 * i + 1] << 8) - c.detector->black_level_dn;
    return e;
}
inline std::vector<int> dark_electrons_of(const Camera& c, std::uint32_t frame = 0) {
    return electrons(c, RadianceImage(c.width, c.height), frame);
}

}  // namespace narpa::test
