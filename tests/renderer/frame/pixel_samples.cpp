// What a pixel's samples say of its truth: sums, variances, intervals.
#include "renderer/frame/pixel_samples.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "renderer/frame/camera_image.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// Half the width of the interval about a pixel's mean that holds the truth in 95 of 100 cases: `variance` as above
/// from `pixels` pixels of `samples` samples, by Student's t with pixels * (samples - 1) degrees of freedom, at
/// least 3 (the quantile by its expansion in their inverse: Abramowitz and Stegun 26.7.5, good to 1 % from 3 on).
double interval_95(double variance, int samples, int pixels) {
    const double z = 1.959963984540054, z2 = z * z, nu = static_cast<double>(pixels) * (samples - 1);
    const double t = z * (1 + (z2 + 1) / (4 * nu) + (5 * z2 * z2 + 16 * z2 + 3) / (96 * nu * nu) +
                          (3 * z2 * z2 * z2 + 19 * z2 * z2 + 17 * z2 - 15) / (384 * nu * nu * nu));
    return t * std::sqrt(variance);
}

TEST(PixelSamples, TwoToThe24EqualSamplesAreExactToOneInAMillion) {
    PixelSamples p;
    const Rgb sample{0.1f, 1e-3f, 1234.567f};
    for (int i = 0; i < 1 << 24; ++i) p.add(sample);
    const Vec3 mean = p.mean();
    for (int b = 0; b < 3; ++b)
        EXPECT_NEAR(mean[b] / static_cast<double>(sample[b]), 1, 1e-6) << b;  // measured 1e-9
    EXPECT_EQ(p.count(), 1 << 24);
    EXPECT_LE(p.squared_deviations() / p.count(), 1e-12 * mean[2] * mean[2]);
}

TEST(PixelSamples, VarianceIsThatOfTheSamples) {
    std::mt19937_64 random(1);
    std::normal_distribution<float> normal(5, 2);
    PixelSamples p;
    std::vector<double> values;
    for (int i = 0; i < 1000; ++i) {
        const Rgb l{normal(random), normal(random), normal(random)};
        p.add(l);
        values.push_back(mean_band(vec_cast<double>(l)));
    }
    const double mean = std::accumulate(values.begin(), values.end(), 0.0) / 1000;
    double squares = 0;
    for (const double v : values) squares += (v - mean) * (v - mean);
    EXPECT_NEAR(p.squared_deviations() / squares, 1, 1e-12);
}

TEST(Interval, QuantilesAreStudents) {
    // Abramowitz and Stegun, table 26.10: 97.5 % points.
    for (const auto& [nu, t] :
         {std::pair{3, 3.182}, {4, 2.776}, {10, 2.228}, {15, 2.131}, {60, 2.000}, {120, 1.980}})
        EXPECT_NEAR(interval_95(1, nu + 1, 1), t, 0.01 * t) << nu;
    EXPECT_DOUBLE_EQ(interval_95(4, 5, 16), 2 * interval_95(1, 65, 1));
}

/// In what part of the pixels the reported interval holds the truth, over blocks of 16 pixels with `draw`n samples.
template <class Draw>
double coverage(int samples, double truth, const Draw& draw) {
    constexpr int kBlocks = 400;
    int held = 0;
    for (int block = 0; block < kBlocks; ++block) {
        std::array<PixelSamples, 16> pixels;
        for (PixelSamples& p : pixels)
            for (int s = 0; s < samples; ++s) {
                const float x = static_cast<float>(draw());
                p.add({x, x, x});
            }
        std::array<double, 16> variance;
        variances_of_means(pixels, variance);
        for (std::size_t i = 0; i < 16; ++i)
            held += std::abs(pixels[i].mean().x - truth) <= interval_95(variance[i], samples, 16);
    }
    return held / (16.0 * kBlocks);
}

// With a pixel's own variance these hold the truth in 65 to 83 % (lognormal, 4 to 64 samples) and 20 %
// (a spot on 0.0137 of the pixel, 16 samples).
TEST(Interval, HoldsTheTruthOfALognormalInNineOfTenPixels) {
    std::mt19937_64 random(20);
    std::lognormal_distribution<double> bright(0, 1.5);
    const double truth = std::exp(0.5 * 1.5 * 1.5);
    for (const int n : {4, 8, 16, 32, 64, 256})
        EXPECT_GE(coverage(n, truth, [&] { return bright(random); }), 0.9) << n;
}

TEST(Interval, HoldsTheTruthOfNormalSamplesWithoutBeingFarTooWide) {
    std::mt19937_64 random(21);
    std::normal_distribution<double> noise(3, 1);
    for (const int n : {2, 4, 16, 64, 256}) {
        const double part = coverage(n, 3, [&] { return noise(random); });
        EXPECT_GE(part, 0.94) << n;
        EXPECT_LE(part, 0.985) << n;
    }
}

TEST(Interval, HoldsTheTruthOfASmallSpotInEveryPixel) {
    std::mt19937_64 random(22);
    std::bernoulli_distribution met(0.0137);
    for (const int n : {16, 64}) EXPECT_GE(coverage(n, 0.0137, [&] { return met(random) ? 1 : 0; }), 0.9) << n;
}

TEST(Interval, APixelsOwnVarianceIsALowerBoundBesideSmoothNeighbours) {
    std::array<PixelSamples, 16> pixels;
    for (PixelSamples& p : pixels)
        for (int s = 0; s < 8; ++s) p.add({1, 1, 1});
    pixels[5] = {};
    for (int s = 0; s < 8; ++s) pixels[5].add(s % 2 == 0 ? Rgb{0, 0, 0} : Rgb{2, 2, 2});
    std::array<double, 16> variance;
    variances_of_means(pixels, variance);
    EXPECT_DOUBLE_EQ(variance[5], 8.0 / 7 / 8);
    EXPECT_GT(variance[6], 0.05 * variance[5]);
    EXPECT_LT(variance[6], 0.07 * variance[5]);
}

/// A frame and the variance that it reports.
struct Shot {
    RadianceImage image;
    Aovs aovs;
};
Shot shoot_frame(const RenderScene& render_scene, const Camera& c, const Rigid3& T, int spp, std::uint32_t frame) {
    Shot shot{RadianceImage(c.width, c.height), {}};
    FrameSettings settings;
    settings.spp = spp;
    settings.frame = frame;
    render_radiance(render_scene, placed(render_scene.scene()), c, T, settings, shot.image, &shot.aovs);
    return shot;
}
double mean_of_bands(const Rgb& p) {
    return mean_band(vec_cast<double>(p));
}

/// Gradients within, edges at the limb, and the empty sky.
Scene sunlit(Mesh body) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, std::move(body));
    add_sun(s, {0.4, 0.5, 1});
    s.ambient = {20, 20, 20};
    return s;
}

TEST(Interval, OfASmoothPictureHoldsTheTruth) {
    // The truth is 1024 samples,
    // whose own error is an eighth of that of 16 or less.
    const Scene s = sunlit(icosphere(4, 1, true));
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const Camera c = camera(32, 32, 40);
    const Rigid3 T = looking({2.5, 1, 1.5}, {0, 0, 0});
    const Shot truth = shoot_frame(*render_scene, c, T, 1024, 1000);
    for (const int spp : {4, 16}) {
        int held = 0, varied = 0;
        for (std::uint32_t frame = 0; frame < 2; ++frame) {
            const Shot shot = shoot_frame(*render_scene, c, T, spp, frame);
            for (std::size_t i = 0; i < shot.image.pixels.size(); ++i) {
                const double variance = static_cast<double>(shot.aovs.variance[i]);
                if (variance == 0) {
                    EXPECT_EQ(shot.image.pixels[i], truth.image.pixels[i]);  // the empty sky
                    continue;
                }
                ++varied;
                held += std::abs(mean_of_bands(shot.image.pixels[i]) - mean_of_bands(truth.image.pixels[i])) <=
                        interval_95(variance, spp, 16);
            }
        }
        EXPECT_GT(varied, 1000);
        EXPECT_GE(held, 0.9 * varied) << spp << ": " << held << " of " << varied;
    }
}

// Independent samples would have 3 to 30 times the variance.
TEST(Interval, OfStratifiedSamplesIsAsLargeAsTheScatterOfFrames) {
    const Scene s = sunlit(icosphere(2, 1, false));
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const Camera c = camera(48, 48, 60);
    const Rigid3 T = looking({2.5, 1, 1.5}, {0, 0, 0});
    for (const int spp : {4, 16, 64, 100}) {
        double stated = 0, scattered = 0;
        for (std::uint32_t frame = 0; frame < 16; ++frame) {
            const Shot a = shoot_frame(*render_scene, c, T, spp, 2 * frame);
            const Shot b = shoot_frame(*render_scene, c, T, spp, 2 * frame + 1);
            for (std::size_t i = 0; i < a.image.pixels.size(); ++i) {
                const double difference = mean_of_bands(a.image.pixels[i]) - mean_of_bands(b.image.pixels[i]);
                scattered += difference * difference;
                stated += static_cast<double>(a.aovs.variance[i]) + static_cast<double>(b.aovs.variance[i]);
            }
        }
        EXPECT_GT(stated / scattered, 0.8) << spp;
        EXPECT_LT(stated / scattered, 2) << spp;
    }
}

TEST(Interval, OfASphereOnAFewThousandthsOfAPixelHoldsTheTruth) {
    // The target: 10 m at 100 km, full phase, 0.0137 px^2, anywhere about the middle of one pixel.
    constexpr double distance = 1e5, f = 1319.4792168823421;
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_sphere(s, 5, {0, 0, 0});
    add_sun(s, {1, 0, 0});
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const double truth = 1361 * 0.5 * 2 / 3 * std::pow(5 * f / distance, 2);
    std::mt19937_64 random(23);
    std::uniform_real_distribution<double> within(-0.4, 0.4);
    for (const int spp : {4, 16, 64}) {
        int held = 0;
        for (std::uint32_t frame = 0; frame < 20; ++frame) {
            Camera c = camera(9, 9, f);
            const double cx = 4 + within(random);
            set_principal_point(c, cx, 4 + within(random));
            const Shot shot = shoot_frame(*render_scene, c, looking({distance, 0, 0}, {}), spp, frame);
            const double half = interval_95(static_cast<double>(shot.aovs.variance[4 * 9 + 4]), spp, 16);
            held += std::abs(mean_of_bands(shot.image.pixels[4 * 9 + 4]) - truth) <= half;
            EXPECT_LT(half, 0.1 * truth);
        }
        EXPECT_GE(held, 18) << spp;
    }
}

}  // namespace
}  // namespace narpa
