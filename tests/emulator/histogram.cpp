#include "emulator/log/histogram.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace narpa {
namespace {

TEST(Histogram, PercentilesAreWithinThreePercentOfTheSamples) {
    std::mt19937_64 rng(3);
    std::lognormal_distribution<double> latency(13, 2);  // around 0.4 ms, with a long tail
    Histogram h;
    std::vector<std::int64_t> all;
    for (int i = 0; i < 100'000; ++i) {
        all.push_back(static_cast<std::int64_t>(latency(rng)));
        h.add(all.back());
    }
    std::sort(all.begin(), all.end());
    for (const double p : {0.01, 0.5, 0.9, 0.99, 0.999}) {
        const auto truth =
            static_cast<double>(all[static_cast<std::size_t>(p * static_cast<double>(all.size())) - 1]);
        EXPECT_NEAR(h.percentile_ns(p) / truth, 1.0, 0.032) << p;
    }
    EXPECT_EQ(h.max_ns(), static_cast<double>(all.back()));
    EXPECT_EQ(h.percentile_ns(1), h.max_ns());
}

TEST(Histogram, SignedPercentilesLieOnBothSidesOfTheMark) {
    SignedHistogram h;
    EXPECT_EQ(h.percentile_ns(0.5), 0);
    std::vector<std::int64_t> all;
    for (std::int64_t t = -9'000; t < 1'000; ++t) {
        all.push_back(1000 * t);
        h.add(all.back());
    }
    EXPECT_EQ(h.count(), all.size());
    for (const double p : {0.001, 0.25, 0.5, 0.899, 0.91, 0.95, 0.999, 1.0}) {
        const auto truth =
            static_cast<double>(all[static_cast<std::size_t>(std::ceil(p * static_cast<double>(all.size()))) - 1]);
        EXPECT_NEAR(h.percentile_ns(p), truth, 0.032 * std::abs(truth) + 1) << p;
    }
    EXPECT_EQ(h.max_ns(), static_cast<double>(all.back()));
    SignedHistogram early;
    early.add(-2'000);
    early.add(-20);
    EXPECT_EQ(early.max_ns(), -20);
}

TEST(Histogram, CountsWhatDoesNotExceedAValue) {
    SignedHistogram h;
    for (std::int64_t t = -5'000'000; t <= 5'000'000; t += 1'000) h.add(t);
    EXPECT_EQ(h.count_up_to(-6'000'000), 0U);
    EXPECT_NEAR(static_cast<double>(h.count_up_to(-1'000'000)), 4'000, 32);  // 3 % of a million
    EXPECT_EQ(h.count_up_to(-1), 5'000U);                                    // exact at the mark
    EXPECT_EQ(h.count_up_to(0), 5'001U);
    EXPECT_NEAR(static_cast<double>(h.count_up_to(3'000'000)), 8'001, 96);
    EXPECT_EQ(h.count_up_to(6'000'000), h.count());
}

TEST(Histogram, ExtremesHaveAPlace) {
    Histogram h;
    EXPECT_EQ(h.percentile_ns(0.5), 0);
    h.add(-5);
    h.add(0);
    h.add(INT64_MAX);
    EXPECT_EQ(h.count(), 3U);
    EXPECT_EQ(h.percentile_ns(0.5), 0);
    EXPECT_EQ(h.max_ns(), static_cast<double>(INT64_MAX));
}

}  // namespace
}  // namespace narpa
