// The detector works on sixteen pixels at a time: that nothing of this shows in the bytes.
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <numbers>

#include "base/each_isa.h"
#include "renderer/detector/detector.h"
#include "renderer/detector/digitise.h"
#include "tests/renderer/detector/detector_support.h"

namespace narpa {
namespace {

using namespace test;

constexpr PixelFormat kFormats[] = {PixelFormat::grey, PixelFormat::y16, PixelFormat::rgb24, PixelFormat::yuyv};

/// One pixel's DN in one band as the header of the detector describes it, with the standard library's functions.
double plain_level(const DetectorConstants& s, double mean_e, std::uint32_t pixel, std::uint32_t band) {
    if (mean_e == 0 && s.dark.any())  // a word of a block for four pixels
        return s.dark.level(philox({pixel / 64 * 16 + pixel % 16, s.frame, 4 + band, 0}, {3, 0})[pixel / 16 % 4]);
    const Block w = philox({pixel, s.frame, band, 0}, {3, 0});
    const double radius = std::sqrt(-2 * std::log((w[0] + 0.5) * 0x1p-32)),
                 angle = 2 * std::numbers::pi * (w[1] + 0.5) * 0x1p-32, normal = radius * std::cos(angle);
    double e = 0;
    if (mean_e >= kPoissonExactBelow) {
        e = std::floor(mean_e + std::sqrt(mean_e - 5.0 / 36) * normal + (normal * normal - 1) / 6 + 0.5);
    } else if (mean_e > 0) {
        const double uniform = (static_cast<double>((std::uint64_t{w[2]} << 32 | w[3]) >> 12) + 0.5) * 0x1p-52;
        double p = std::exp(-mean_e), sum = p;
        for (; sum < uniform; sum += p) p *= mean_e / ++e;
    }
    return s.black_dn + (std::min(e, s.full_well_e) + s.read_noise_e * radius * std::sin(angle)) * s.dn_per_e;
}
double plain_electrons(const DetectorConstants& s, float radiance, std::size_t band) {
    const double e = s.electrons_per_radiance[band] * static_cast<double>(radiance);
    return e > 0 ? e : 0;
}

TEST(DetectorPackets, ValuesAreThoseOfThePlainDescription) {
    const int width = 211, height = 53;
    const RadianceImage image = motley(width, height);
    for (const PixelFormat format : {PixelFormat::y16, PixelFormat::rgb24}) {
        const Camera c = noisy_camera(width, height, format);
        const DetectorConstants s = detector_constants(c, 3, 8);
        const std::vector<std::uint8_t> bytes = bytes_of(c, image);
        int near_an_edge = 0;
        const auto expect = [&](double mean_e, std::size_t pixel, std::uint32_t band, int shift, int got) {
            const double level = std::clamp(plain_level(s, mean_e, static_cast<std::uint32_t>(pixel), band), 0.0,
                                            static_cast<double>(s.top_dn));
            // Single precision may carry a level over the edge between two numbers, an electron more or less too.
            const auto dn = [&](double off) { return static_cast<int>(std::floor(level + off + 0.5)) >> shift; };
            const double reach = s.dn_per_e;
            EXPECT_GE(got, std::max(0, dn(-reach))) << pixel;
            EXPECT_LE(got, std::min(s.top_dn >> shift, dn(reach))) << pixel;
            near_an_edge += got != dn(0);
        };
        for (std::size_t i = 0; i < image.pixels.size(); ++i) {
            const Rgb& l = image.pixels[i];
            if (format == PixelFormat::y16) {
                double mean_e = 0;
                for (std::size_t b = 0; b < 3; ++b) mean_e += plain_electrons(s, l[static_cast<int>(b)], b);
                if (std::isfinite(mean_e))
                    expect(mean_e, i, 0, 0, (bytes[2 * i] | bytes[2 * i + 1] << 8) >> (16 - s.bits));
            } else {
                for (std::uint32_t b = 0; b < 3; ++b)
                    if (const double mean_e = plain_electrons(s, l[static_cast<int>(b)], b); std::isfinite(mean_e))
                        expect(mean_e, i, b, s.bits - 8, bytes[3 * i + b]);
            }
        }
        // Normals are 1e-6 off, their electrons a ten thousandth, and a number lies that near to the next.
        EXPECT_LT(near_an_edge, 1e-3 * static_cast<double>(image.pixels.size()));
    }
}

TEST(DetectorPackets, AnyWidthIsTheSameRowOfPixels) {
    const RadianceImage row = motley(340, 1);
    for (const PixelFormat format : kFormats) {
        const std::vector<std::uint8_t> whole = bytes_of(noisy_camera(340, 1, format), row);
        for (const int width : {2, 10, 34, 68, 170, 340}) {
            RadianceImage image(width, 340 / width);
            image.pixels = row.pixels;
            EXPECT_EQ(bytes_of(noisy_camera(width, 340 / width, format), image), whole) << width;
        }
        for (const std::size_t count : {1u, 2u, 15u, 16u, 17u, 31u, 33u}) {
            if (format == PixelFormat::yuyv && count % 2 == 1) continue;
            RadianceImage image(static_cast<int>(count), 1);
            std::copy_n(row.pixels.begin(), count, image.pixels.begin());
            const std::size_t size = count * bytes_per_pixel(format);
            std::vector<std::uint8_t> out(size + 64, 0xa5);  // nothing beyond its end is touched
            expose(noisy_camera(static_cast<int>(count), 1, format), image, 3, 8, std::span(out).first(size));
            EXPECT_TRUE(std::equal(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size), whole.begin()));
            EXPECT_EQ(std::vector<std::uint8_t>(out.end() - 64, out.end()), std::vector<std::uint8_t>(64, 0xa5));
        }
    }
}

TEST(DetectorPackets, SameBytesOnAnyNumberOfThreads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
    const RadianceImage image = motley(322, 261);  // several tasks and a part of one
    for (const PixelFormat format : kFormats) {
        const Camera c = noisy_camera(image.width, image.height, format);
        std::vector<std::uint8_t> one, many;
        tbb::task_arena(1).execute([&] { one = bytes_of(c, image); });
        tbb::task_arena(4).execute([&] { many = bytes_of(c, image); });
        EXPECT_EQ(one, many);
    }
}

TEST(DetectorPackets, YuyvRoundsItsFormulaExactly) {
    // All differences between a byte of the formula in double and the exact one are at ties.
    Camera c = camera(512, 512, 100);
    c.format = PixelFormat::rgb24;
    c.white_radiance = 1;
    RadianceImage image(512, 512);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const Block w = philox({static_cast<std::uint32_t>(i), 0, 0, 0}, {1, 1});
        const auto even = [](std::uint32_t word) { return static_cast<float>(word >> 8) * 0x1p-24f; };
        image.pixels[i] = {even(w[0]), even(w[1]), even(w[2])};
    }
    const std::vector<std::uint8_t> rgb = bytes_of(c, image);
    c.format = PixelFormat::yuyv;
    const std::vector<std::uint8_t> yuyv = bytes_of(c, image);
    const auto expect = [](int got, double value) { ASSERT_NEAR(got, value, 0.5 + 1e-9); };
    for (std::size_t i = 0; i < image.pixels.size(); i += 2) {
        const std::uint8_t *p = &rgb[3 * i], *out = &yuyv[2 * i];
        const double r = (p[0] + p[3]) / 2.0, g = (p[1] + p[4]) / 2.0, b = (p[2] + p[5]) / 2.0;
        expect(out[0], 16 + (65.481 * p[0] + 128.553 * p[1] + 24.966 * p[2]) / 255);
        expect(out[2], 16 + (65.481 * p[3] + 128.553 * p[4] + 24.966 * p[5]) / 255);
        expect(out[1], 128 + (-37.797 * r - 74.203 * g + 112 * b) / 255);
        expect(out[3], 128 + (112 * r - 93.786 * g - 18.214 * b) / 255);
    }
}

#ifdef NARPA_HAS_EACH_ISA
// The inner loop as each instruction set has it; `expose` takes the widest that the machine knows.
using Write = void(const DetectorConstants&, PixelFormat, std::span<const Rgb>, std::size_t, std::uint8_t*);
[[gnu::flatten]] void on_base_line(const DetectorConstants& s, PixelFormat f, std::span<const Rgb> l,
                                   std::size_t first, std::uint8_t* out) {
    write_pixels(s, f, l, first, out);
}
[[gnu::flatten, gnu::target("arch=x86-64-v3")]] void on_avx2(const DetectorConstants& s, PixelFormat f,
                                                             std::span<const Rgb> l, std::size_t first,
                                                             std::uint8_t* out) {
    write_pixels(s, f, l, first, out);
}
TEST(DetectorPackets, SameBytesOnEachInstructionSet) {
    const RadianceImage image = motley(123, 30);
    for (const PixelFormat format : kFormats)
        for (const bool noisy : {true, false}) {
            Camera c = noisy_camera(124, 30, format);
            if (!noisy) c.detector->shot_noise = false, c.detector->read_noise_e = 0;
            const std::vector<std::uint8_t> widest = bytes_of(c, image);
            const DetectorConstants s = detector_constants(c, 3, 8);
            for (Write* const write : {&on_base_line, &on_avx2}) {
                if (write == &on_avx2 && !__builtin_cpu_supports("avx2")) continue;
                std::vector<std::uint8_t> out(widest.size());
                write(s, format, image.pixels, 0, out.data());
                EXPECT_EQ(out, widest) << name(format);
            }
        }
}
#endif

}  // namespace
}  // namespace narpa
