// Sample points for the many dimensions of a path.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "renderer/integrator/sampler.h"

namespace narpa {
namespace {

constexpr std::uint32_t kGroups[]{0, 1, 2, 7, 40, 81};

TEST(PathSampler, TheFirstGroupBelongsToThePixel) {
    const PixelSampler sampler(5, 2, 77);
    for (std::uint32_t s = 0; s < 100; ++s) EXPECT_EQ(sampler.point(s, 0), sampler.point(s));
}

TEST(PathSampler, EveryGroupIsStratifiedInEachDimensionAndInItsFirstTwo) {
    constexpr std::uint32_t n = 256;
    for (const std::uint32_t group : kGroups) {
        const PixelSampler sampler(5, 2, 77);
        for (const std::uint32_t start : {0U, 3 * n}) {  // any aligned power of two of samples
            for (unsigned dim = 0; dim < 4; ++dim) {
                std::set<int> strata;
                for (std::uint32_t s = start; s < start + n; ++s)
                    strata.insert(static_cast<int>(n * sampler.point(s, group)[dim]));
                EXPECT_EQ(strata.size(), n) << group << ' ' << dim;
            }
            // Elementary intervals of the first two: 16 x 16, 64 x 4, 4 x 64.
            for (const int wide : {16, 64, 4}) {
                std::set<std::pair<int, int>> cells;
                for (std::uint32_t s = start; s < start + n; ++s) {
                    const SamplePoint p = sampler.point(s, group);
                    cells.insert(
                        {static_cast<int>(wide * p[0]), static_cast<int>(static_cast<int>(n) / wide * p[1])});
                }
                EXPECT_EQ(cells.size(), n) << group;
            }
        }
    }
}

TEST(PathSampler, GroupsAndPixelsAreIndependent) {
    // Correlation of two independent even numbers over n samples has the standard deviation 1 / sqrt(n).
    constexpr std::uint32_t n = 4096;
    const PixelSampler sampler(5, 2, 77), neighbour(5, 2, 78);
    const auto correlation = [&](const auto& a, const auto& b) {
        double sum = 0;
        for (std::uint32_t s = 0; s < n; ++s) sum += (a(s) - 0.5) * (b(s) - 0.5);
        return 12 * sum / n;
    };
    for (const std::uint32_t group : kGroups)
        for (unsigned dim = 0; dim < 4; ++dim) {
            const auto own = [&](std::uint32_t s) { return sampler.point(s, group)[dim]; };
            for (const std::uint32_t other : kGroups) {
                if (other == group) continue;
                for (unsigned k = 0; k < 4; ++k) {
                    const auto foreign = [&](std::uint32_t s) { return sampler.point(s, other)[k]; };
                    EXPECT_LT(std::abs(correlation(own, foreign)), 5 / std::sqrt(1.0 * n)) << group << ' ' << other;
                }
            }
            if (group == 0) continue;  // in the same order in all pixels
            const auto beside = [&](std::uint32_t s) { return neighbour.point(s, group)[dim]; };
            EXPECT_LT(std::abs(correlation(own, beside)), 5 / std::sqrt(1.0 * n)) << group;
        }
}

}  // namespace
}  // namespace narpa
