// The random numbers of the detector, sixteen pixels side by side, against the standard library and the
// distributions that they stand for.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "renderer/detector/noise.h"
#include "tests/renderer/detector/detector_philox.h"

namespace narpa {
namespace {

using test::Block;
using test::philox;

double open_unit(std::uint32_t word) {
    return (word + 0.5) * 0x1p-32;
}
/// Words that stand at the edges of the functions' pieces, and some in between.
std::vector<std::uint32_t> telling_words() {
    std::vector<std::uint32_t> words;
    for (const std::uint32_t edge : {0u, 0x20000000u, 0x40000000u, 0x60000000u, 0x80000000u, 0xa0000000u,
                                     0xb504f334u, 0xc0000000u, 0xe0000000u, 0x00ffffffu})
        for (std::uint32_t i = 0; i < 64; ++i) words.push_back(edge - 32 + i);
    for (std::uint32_t i = 0; i < 400'000; ++i) words.push_back(philox({i, 0, 0, 0}, {1, 2})[0] >> (i % 32));
    return words;
}
/// The largest distance of an empirical distribution from a continuous one; sorts the values.
template <class Distribution>
double kolmogorov(std::vector<double>& values, Distribution below) {
    std::sort(values.begin(), values.end());
    const auto n = static_cast<double>(values.size());
    double worst = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double p = below(values[i]), k = static_cast<double>(i);
        worst = std::max({worst, std::abs(p - k / n), std::abs(p - (k + 1) / n)});
    }
    return worst;
}

TEST(Philox, GivesThePublishedNumbers) {
    // Known answers of Random123 (D. E. Shaw Research), philox4x32 10 rounds.
    EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
    EXPECT_EQ(philox({0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}, {0xffffffff, 0xffffffff}),
              (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
    EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
              (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Philox, SideBySideIsTheSame) {
    for (const std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{0x123456789abcdef0}, ~std::uint64_t{0}})
        for (const std::uint32_t first : {0u, 12'345u, 0xfffffff8u})  // the last wraps
            for (const std::uint32_t frame : {0u, 77u, 0xffffffffu}) {
                const RandomLanes lanes = philox(PhiloxSchedule(seed), first, frame, 2);
                for (std::uint32_t i = 0; i < kLanes; ++i)
                    ASSERT_EQ((Block{lanes.w0[i], lanes.w1[i], lanes.w2[i], lanes.w3[i]}),
                              philox({first + i, frame, 2, 0},
                                     {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)}));
            }
}

TEST(Noise, FunctionsAreThoseOfTheStandardLibrary) {
    double log_error = 0, angle_error = 0;
    for (const std::uint32_t word : telling_words()) {
        const double log = -std::log(open_unit(word)), angle = 2 * std::numbers::pi * open_unit(word);
        log_error = std::max(log_error, std::abs(static_cast<double>(minus_log(word)) / log - 1));
        const SineCosine v = sincos_of_word(word);
        angle_error = std::max({angle_error, std::abs(static_cast<double>(v.sine) - std::sin(angle)),
                                std::abs(static_cast<double>(v.cosine) - std::cos(angle))});
    }
    EXPECT_LT(log_error, 2.5e-7);
    EXPECT_LT(angle_error, 1.5e-7);
}

TEST(Noise, NormalsAreThoseOfBoxAndMuller) {
    const std::vector<std::uint32_t> words = telling_words();
    double worst = 0;
    for (std::size_t k = 0; k + kLanes <= words.size(); k += kLanes) {
        RandomLanes random{};
        for (std::size_t i = 0; i < kLanes; ++i)
            random.w0[i] = words[k + i], random.w1[i] = words[words.size() - 1 - k - i];
        const NormalLanes normal = normals(random);
        for (std::size_t i = 0; i < kLanes; ++i) {
            const double radius = std::sqrt(-2 * std::log(open_unit(random.w0[i]))),
                         angle = 2 * std::numbers::pi * open_unit(random.w1[i]);
            worst = std::max({worst, std::abs(static_cast<double>(normal.a[i]) - radius * std::cos(angle)),
                              std::abs(static_cast<double>(normal.b[i]) - radius * std::sin(angle))});
        }
    }
    EXPECT_LT(worst, 1e-6);
}

TEST(Noise, HasItsDistributions) {
    std::vector<double> a, b, even;
    for (std::uint32_t first = 0; first < 400'000; first += kLanes) {
        const RandomLanes random = philox(PhiloxSchedule(4), first, 0, 0);
        const NormalLanes normal = normals(random);
        const Lanes<double> uniform = uniforms(random);
        for (std::size_t i = 0; i < kLanes; ++i) {
            a.push_back(static_cast<double>(normal.a[i]));
            b.push_back(static_cast<double>(normal.b[i]));
            even.push_back(uniform[i]);
            ASSERT_GT(uniform[i], 0);
            ASSERT_LT(uniform[i], 1);
        }
    }
    // Kolmogorov: beyond 1.6 / sqrt(n) lies one in a hundred.
    const double limit = 1.6 / std::sqrt(static_cast<double>(a.size()));
    const auto gauss = [](double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); };
    EXPECT_LT(kolmogorov(a, gauss), limit);
    EXPECT_LT(kolmogorov(b, gauss), limit);
    EXPECT_LT(kolmogorov(even, [](double x) { return x; }), limit);
}

/// The definition: the count whose sum of probabilities first reaches `uniform`.
double inverted(double mean, double uniform) {
    double p = std::exp(-mean), sum = p;
    int k = 0;
    for (; sum < uniform && k < 200; ++k) {
        p *= mean / (k + 1);
        sum += p;
    }
    return k;
}

TEST(Poisson, FaintCountsAreExact) {
    std::uint32_t first = 0;
    for (int round = 0; round < 2000; ++round, first += kLanes) {
        const RandomLanes random = philox(PhiloxSchedule(6), first, 0, 0);
        const Lanes<double> uniform = uniforms(random);
        Lanes<double> mean;
        for (std::size_t i = 0; i < kLanes; ++i)
            mean[i] = i == 3 ? 0 : kPoissonExactBelow * std::pow(open_unit(random.w0[i]), round % 4 + 1);
        const Lanes<double> count = exact_poisson(mean, uniform);
        for (std::size_t i = 0; i < kLanes; ++i) ASSERT_EQ(count[i], inverted(mean[i], uniform[i])) << mean[i];
    }
    Lanes<double> high, mean;
    high.fill(1 - 0x1p-36);
    mean.fill(31.999);
    EXPECT_EQ(exact_poisson(mean, high)[0], inverted(31.999, high[0]));
    high.fill(1 - 0x1p-53);
    EXPECT_LT(exact_poisson(mean, high)[0], 120);  // ends, though rounding may keep the sum below
}

TEST(Poisson, LanesKnowNothingOfEachOther) {
    const Lanes<double> means{0, 3, 0, 31.9, 32, 1e5, 0.01, 0, 40, 0, 0, 7, 1e27, 0, 0, 20};
    const RandomLanes random = philox(PhiloxSchedule(9), 0, 0, 0);
    const NormalLanes normal = normals(random);
    const Lanes<double> together = poisson(means, normal, random);
    for (std::size_t i = 0; i < kLanes; ++i) {
        Lanes<double> alone{};
        alone[i] = means[i];
        EXPECT_EQ(poisson(alone, normal, random)[i], together[i]) << means[i];
    }
    for (const std::size_t dark : {0u, 2u, 7u}) EXPECT_EQ(together[dark], 0);
    EXPECT_NEAR(together[12] / 1e27, 1, 1e-12);
}

TEST(Poisson, FaintCountsHaveTheClosedFormByChiSquared) {
    constexpr std::uint32_t n = 1'600'000;  // seed 13
    for (const double mean : {0.05, 0.5, 2.0, 10.0}) {
        Lanes<double> means;
        means.fill(mean);
        std::vector<double> count(64);
        double sum = 0, squares = 0, cubes = 0;
        for (std::uint32_t first = 0; first < n; first += kLanes) {
            const RandomLanes random = philox(PhiloxSchedule(13), first, 0, 0);
            for (const double k : poisson(means, normals(random), random)) {
                ++count.at(static_cast<std::size_t>(k));
                sum += k, squares += (k - mean) * (k - mean), cubes += std::pow(k - mean, 3);
            }
        }
        // Central moments mean, mean, mean (skewness mean^-1/2); four standard errors of each estimate.
        const double m2 = mean * mean, m3 = m2 * mean;
        EXPECT_NEAR(sum / n, mean, 4 * std::sqrt(mean / n)) << mean;
        EXPECT_NEAR(squares / n, mean, 4 * std::sqrt((mean + 2 * m2) / n)) << mean;
        EXPECT_NEAR(cubes / n, mean, 4 * std::sqrt((mean + 18 * m2 + 6 * m3) / n)) << mean;
        double p = std::exp(-mean), chi_squared = 0, rest = n, rest_count = n;
        int classes = 0;
        for (std::size_t k = 0; p * n >= 10 || static_cast<double>(k) < mean;
             p *= mean / static_cast<double>(++k)) {
            const double expected = p * n;
            if (k < 3) {
                EXPECT_NEAR(count[k], expected, 4 * std::sqrt(expected * (1 - p))) << "P(" << k << ") of " << mean;
            }
            chi_squared += (count[k] - expected) * (count[k] - expected) / expected;
            rest -= expected, rest_count -= count[k];
            ++classes;
        }
        chi_squared += (rest_count - rest) * (rest_count - rest) / rest;  // all beyond, as one class
        // `classes` degrees of freedom; exceeded once in about 1e4.
        EXPECT_LT(chi_squared, classes + 4.5 * std::sqrt(2.0 * classes)) << mean;
    }
}

TEST(Poisson, HasTheDistributionOnBothSidesOfTheThreshold) {
    constexpr std::uint32_t n = 400'000;
    for (const double mean : {0.3, 4.0, 31.9, 32.1, 200.0}) {
        Lanes<double> means;
        means.fill(mean);
        std::vector<int> count(600);
        double sum = 0, squares = 0, cubes = 0;
        for (std::uint32_t first = 0; first < n; first += kLanes) {
            const RandomLanes random = philox(PhiloxSchedule(11), first, 0, 0);
            for (const double k : poisson(means, normals(random), random)) {
                ASSERT_EQ(k, std::floor(k));
                ++count[static_cast<std::size_t>(k)];
                sum += k, squares += (k - mean) * (k - mean), cubes += std::pow(k - mean, 3);
            }
        }
        EXPECT_NEAR(sum / n, mean, 5 * std::sqrt(mean / n)) << mean;
        EXPECT_NEAR(squares / n / mean, 1, 5 * std::sqrt((2 + 1 / mean) / n)) << mean;
        EXPECT_NEAR(cubes / n / mean, 1, 0.1 + 0.02 * std::sqrt(mean)) << mean;
        double p = std::exp(-mean), below = 0, cumulative = 0, worst = 0;
        for (std::size_t k = 0; k < count.size(); ++k) {
            below += p;
            cumulative += count[k];
            worst = std::max(worst, std::abs(cumulative / n - below));
            p *= mean / (static_cast<double>(k) + 1);
        }
        EXPECT_LT(worst, 1.6 / std::sqrt(double{n}) + (mean < kPoissonExactBelow ? 0 : 1e-3))
            << mean;  // Kolmogorov
    }
}

}  // namespace
}  // namespace narpa
