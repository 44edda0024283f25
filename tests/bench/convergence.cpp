// The statistics of `narpa bench render`, on images whose noise and bias are known.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "bench/convergence.h"

namespace narpa {
namespace {

constexpr std::size_t kPixels = 32 * 32;
constexpr int kImages = 16;
const std::vector<int> kSpp{4, 8, 16, 32};

/// Noise of one sample in a pixel: from pixel to pixel it differs by three.
float sigma(std::size_t pixel) {
    return 0.5f * (1 + 2 * static_cast<float>(pixel) / kPixels);
}

/// A image whose values are 1 in each band, plus noise that falls as 1/sqrt(spp), plus what the test adds.
using Extra = std::function<float(std::size_t pixel)>;
std::vector<Rgb> image(std::mt19937_64& random, double spp, const Extra& extra = {}) {
    std::normal_distribution<float> normal;
    std::vector<Rgb> p(kPixels);
    for (std::size_t i = 0; i < kPixels; ++i) {
        const float noise = sigma(i) / static_cast<float>(std::sqrt(spp)), shift = 1 + (extra ? extra(i) : 0);
        p[i] = {shift + noise * normal(random), shift + noise * normal(random), shift + noise * normal(random)};
    }
    return p;
}

ImageMean reference(std::mt19937_64& random, double spp_each = 256) {
    ImageMean mean(kPixels);
    for (int k = 0; k < kImages; ++k) mean.add(image(random, spp_each));
    return mean;
}

std::vector<ErrorRow> rows(std::mt19937_64& random, const ImageMean& truth, double power = 1,
                           const Extra& extra = {}) {
    std::vector<ErrorRow> rows;
    for (const int spp : kSpp) {
        ErrorAgainst error(truth);
        for (int k = 0; k < kImages; ++k) error.add(image(random, std::pow(spp, power), extra));
        rows.push_back(error.row(spp));
    }
    return rows;
}

double true_rmse(double spp) {
    double sum = 0;
    for (std::size_t i = 0; i < kPixels; ++i) sum += sigma(i) * sigma(i);
    return std::sqrt(sum / kPixels / spp);
}

TEST(BenchConvergence, IndependentNoiseFallsWithSlopeMinusOneHalfAndHasNoBias) {
    std::mt19937_64 random(1);
    const ImageMean truth = reference(random);
    const std::vector<ErrorRow> found = rows(random, truth);
    for (const ErrorRow& r : found) {
        EXPECT_EQ(r.images, static_cast<std::size_t>(kImages));
        // 49,152 squares of normal numbers a row: their mean is known to sqrt(2 / 49152) = 0.6 %, the root to 0.3
        // %.
        EXPECT_NEAR(r.rmse.value, true_rmse(r.spp), 4 * 0.0035 * true_rmse(r.spp)) << r.spp;
        EXPECT_NEAR(r.rmse.standard_error, 0.0035 * true_rmse(r.spp), 0.002 * true_rmse(r.spp)) << r.spp;
        EXPECT_NEAR(r.relative_rmse.value, r.rmse.value, 0.01 * r.rmse.value) << r.spp;  // the radiance is 1
        EXPECT_LT(std::abs(r.bias.sigmas()), 3) << r.spp;
        EXPECT_LT(std::abs(r.pixel_bias_squared.sigmas()), 3) << r.spp;
    }
    const Estimate slope = fit_slope(found);
    EXPECT_LT(slope.standard_error, 0.01);
    EXPECT_NEAR(slope.value, -0.5, 4 * slope.standard_error);
    EXPECT_TRUE(convergence_faults(found).empty());
}

TEST(BenchConvergence, TheReferencesOwnNoiseIsTakenOut) {
    std::mt19937_64 random(2);
    const ImageMean poor = reference(random, 2);  // 32 spp in all: as noisy as the images
    // 3072 squared differences: their mean is known to sqrt(2 / 3072) = 2.6 %, the root to 1.3 %.
    EXPECT_NEAR(std::sqrt(poor.variance_of_mean()), true_rmse(32), 4 * 0.014 * true_rmse(32));
    ErrorAgainst error(poor);
    for (int k = 0; k < kImages; ++k) error.add(image(random, 32));
    EXPECT_NEAR(error.row(32).rmse.value, true_rmse(32), 0.06 * true_rmse(32));  // left in: 41 % more
}

TEST(BenchConvergence, DarkPixelsCountInTheRelativeErrorAsBrightOnesDo) {
    // Half the pixels a hundred times as bright and as noisy: the RMSE is theirs, the relative error everyone's.
    std::mt19937_64 random(9);
    const auto bright_half = [&](double spp) {
        std::vector<Rgb> p = image(random, spp);
        for (std::size_t i = 0; i < kPixels; i += 2) p[i] = 100.0f * p[i];
        return p;
    };
    ImageMean truth(kPixels);
    for (int k = 0; k < kImages; ++k) truth.add(bright_half(1024));
    ErrorAgainst error(truth);
    for (int k = 0; k < kImages; ++k) error.add(bright_half(4));
    const ErrorRow row = error.row(4);
    EXPECT_NEAR(row.rmse.value, 100 * true_rmse(4) / std::sqrt(2), 0.02 * 100 * true_rmse(4));
    EXPECT_NEAR(row.relative_rmse.value, true_rmse(4), 0.02 * true_rmse(4));
}

TEST(BenchConvergence, AMeanErrorOfAHundredthIsFound) {
    std::mt19937_64 random(3);
    const ImageMean truth = reference(random);
    const std::vector<ErrorRow> found = rows(random, truth, 1, [](std::size_t) { return 0.01f; });
    for (const ErrorRow& r : found) EXPECT_NEAR(r.bias.value, 0.01, 4 * r.bias.standard_error) << r.spp;
    const std::vector<std::string> faults = convergence_faults(found);
    ASSERT_FALSE(faults.empty());
    EXPECT_NE(faults.back().find("mean error"), std::string::npos) << faults.back();
}

TEST(BenchConvergence, ErrorsThatCancelOverTheImageAreFoundInItsPixels) {
    std::mt19937_64 random(4);
    const ImageMean truth = reference(random);
    const auto to_and_fro = [](std::size_t i) { return i % 2 == 0 ? 0.05f : -0.05f; };
    const std::vector<ErrorRow> found = rows(random, truth, 1, to_and_fro);
    for (const ErrorRow& r : found) {
        EXPECT_LT(std::abs(r.bias.sigmas()), 3) << r.spp;
        EXPECT_NEAR(r.pixel_bias_squared.value, 0.05 * 0.05, 4 * r.pixel_bias_squared.standard_error) << r.spp;
    }
    const std::vector<std::string> faults = convergence_faults(found);
    ASSERT_FALSE(faults.empty());
    EXPECT_NE(faults.front().find("pixels are off by 0.0"), std::string::npos) << faults.front();
}

TEST(BenchConvergence, AnErrorThatFallsTooSlowlyIsFound) {
    std::mt19937_64 random(5);
    const ImageMean truth = reference(random);
    const std::vector<ErrorRow> found = rows(random, truth, 0.9);
    const Estimate slope = fit_slope(found);
    EXPECT_NEAR(slope.value, -0.45, 4 * slope.standard_error);
    const std::vector<std::string> faults = convergence_faults(found);
    ASSERT_EQ(faults.size(), 2u);  // the error and the relative error
    EXPECT_NE(faults[0].find("falls as spp^-0.4"), std::string::npos) << faults[0];
}

TEST(BenchConvergence, StandardErrorsAreNeitherTooSmallNorTooLarge) {
    // 200 benches: their sigmas scatter as Student's t of 15 and 15 degrees does, 1.07 rms; the rms of 200 is known
    // to 5 %.
    constexpr int kTrials = 200;
    double squares = 0, pixel = 0;
    std::mt19937_64 random(6);
    for (int i = 0; i < kTrials; ++i) {
        ImageMean truth(kPixels);
        for (int k = 0; k < kImages; ++k) truth.add(image(random, 8));
        ErrorAgainst error(truth);
        for (int k = 0; k < kImages; ++k) error.add(image(random, 4));
        const ErrorRow row = error.row(4);
        squares += row.bias.sigmas() * row.bias.sigmas();
        pixel += row.pixel_bias_squared.sigmas() * row.pixel_bias_squared.sigmas();
    }
    EXPECT_NEAR(std::sqrt(squares / kTrials), 1.07, 4 * 0.055);
    EXPECT_NEAR(std::sqrt(pixel / kTrials), 1.0, 4 * 0.05);
}

TEST(BenchConvergence, AMeanOfManyImagesLosesNothingWhateverTheirNumber) {
    const std::vector<Rgb> p{{0.1f, 1e6f, 1e-6f}};
    for (const int count : {1, 2, 3, 100'000}) {
        ImageMean mean(1);
        for (int k = 0; k < count; ++k) mean.add(p);
        for (std::size_t band = 0; band < 3; ++band) {
            const auto x = static_cast<double>(p[0][static_cast<int>(band)]);
            EXPECT_NEAR(mean.mean(band), x, 1e-12 * x) << count;
        }
    }
}

TEST(BenchConvergence, AnOddNumberOfImagesHasTheRightVariance) {
    std::mt19937_64 random(8);
    ImageMean mean(kPixels);
    for (int k = 0; k < 3; ++k) mean.add(image(random, 4));
    EXPECT_NEAR(std::sqrt(mean.variance_of_mean()), true_rmse(3 * 4), 4 * 0.014 * true_rmse(3 * 4));
}

TEST(BenchConvergence, FitsAPowerLawExactlyAndReportsWhereThereIsNone) {
    std::vector<ErrorRow> found;
    for (const int spp : {2, 10, 300})
        found.push_back({spp, 4, {3 * std::pow(spp, -0.75), 0.01 * spp}, {}, {}, {}});
    EXPECT_NEAR(fit_slope(found).value, -0.75, 1e-12);
    found.resize(1);
    EXPECT_EQ(fit_slope(found).value, 0);
    EXPECT_TRUE(convergence_faults(found).empty());  // one row has no slope to judge
    const std::vector<ErrorRow> without_noise{{4, 4, {}, {}, {}, {}}, {8, 4, {}, {}, {}, {}}};
    EXPECT_EQ(convergence_faults(without_noise).size(), 2u);  // of neither error
}

}  // namespace
}  // namespace narpa
