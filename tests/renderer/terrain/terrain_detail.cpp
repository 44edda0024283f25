// Craters and rocks between the posts: as many as published, the same in every run, and none that nobody named.
#include "renderer/terrain/detail.h"

#include <gtest/gtest.h>

#include "tests/support/height_grid.h"

namespace narpa {
namespace {

using test::HeightGrid, test::rough_ground;

std::vector<double> all_of(HeightSource& source) {
    std::vector<double> h(static_cast<std::size_t>(source.columns()) * static_cast<std::size_t>(source.rows()));
    EXPECT_TRUE(source.read_rows(0, source.rows(), h.data()));
    return h;
}

TEST(TerrainDetail, WithoutFeaturesItIsSmoothThroughThePosts) {
    const auto bowl = [](double c, double r) { return 0.3 * c * c - 0.2 * c * r + 0.1 * r * r - 4 * c + r; };
    HeightGrid grid(20, 17, bowl);
    DetailedSource fine(grid, {1, 1}, {.refinement_factor = 4});
    EXPECT_EQ(fine.columns(), 19 * 4 + 1);
    EXPECT_EQ(fine.rows(), 16 * 4 + 1);
    const std::vector<double> h = all_of(fine);
    for (int r = 0; r < fine.rows(); ++r)
        for (int c = 0; c < fine.columns(); ++c) {
            const double height = h[static_cast<std::size_t>(r * fine.columns() + c)], x = c / 4.0, y = r / 4.0;
            if (c % 4 == 0 && r % 4 == 0) {
                EXPECT_EQ(height, grid.at(c / 4, r / 4));
            } else if (x >= 1 && x <= 18 && y >= 1 && y <= 15) {
                EXPECT_NEAR(height, bowl(x, y), 1e-12) << "the spline is exact to the second order";
            }
        }
}

TEST(TerrainDetail, BesideAHoleItIsTheTrianglesOfTheDem) {
    const auto ground = [](int c, int r) { return c == 9 && r == 8 ? kNoHeight : rough_ground(c, r); };
    HeightGrid grid(20, 17, ground);
    DetailedSource fine(grid, {1, 1}, {.refinement_factor = 4});
    const std::vector<double> h = all_of(fine);
    int holes = 0;
    for (int r = 6 * 4 + 1; r < 10 * 4; ++r)
        for (int c = 7 * 4 + 1; c < 11 * 4; ++c) {
            if (c % 4 == 0 && r % 4 == 0) continue;
            const double u = c % 4 / 4.0, v = r % 4 / 4.0;
            const auto at = [&](int dc, int dr) { return grid.at(c / 4 + dc, r / 4 + dr); };
            const double expected = u >= v ? at(0, 0) + u * (at(1, 0) - at(0, 0)) + v * (at(1, 1) - at(1, 0))
                                           : at(0, 0) + v * (at(0, 1) - at(0, 0)) + u * (at(1, 1) - at(0, 1));
            const double height = h[static_cast<std::size_t>(r * fine.columns() + c)];
            ASSERT_EQ(height == height, expected == expected);
            if (expected == expected) {
                EXPECT_NEAR(height, expected, 1e-12);
            }
            holes += expected == expected ? 0 : 1;
        }
    EXPECT_GT(holes, 30);
}

TEST(TerrainDetail, APlanetHasNoSeam) {
    const auto bumps = [](int c, int r) { return std::sin(2 * 3.14159265358979 * (c % 24) / 24) * r; };
    HeightGrid grid(25, 9, bumps, true);
    DetailedSource fine(grid, {1, 1}, {.refinement_factor = 4});
    const std::vector<double> h = all_of(fine);
    const auto at = [&](int c, int r) { return h[static_cast<std::size_t>(r * fine.columns() + c)]; };
    for (int r = 0; r < fine.rows(); ++r) {
        EXPECT_EQ(at(0, r), at(fine.columns() - 1, r));
        // The slope from the left equals that to the right: a sine is odd about the seam.
        EXPECT_NEAR(at(1, r), -at(fine.columns() - 2, r), 1e-9);
    }
}

TEST(TerrainDetail, WindowsAreTheSameHoweverTheyAreRead) {
    HeightGrid grid(40, 40, rough_ground);
    DetailedSource fine(grid, {1, 1}, {.refinement_factor = 8, .craters = 0.079, .rocks = 0.1, .seed = 7});
    const std::vector<double> h = all_of(fine);
    std::vector<double> rows(static_cast<std::size_t>(3 * fine.columns()));
    for (int r = 0; r + 3 <= fine.rows(); r += 3) {
        ASSERT_TRUE(fine.read_rows(r, 3, rows.data()));
        for (std::size_t i = 0; i < rows.size(); ++i)
            ASSERT_EQ(rows[i], h[static_cast<std::size_t>(r * fine.columns()) + i]);
    }
    DetailedSource other(grid, {1, 1}, {.refinement_factor = 8, .craters = 0.079, .rocks = 0.1, .seed = 8});
    EXPECT_NE(all_of(other), h);
}

TEST(TerrainDetail, RocksCoverThePublishedShare) {
    HeightGrid flat(201, 201, [](int, int) { return 0.0; });
    constexpr double kShare = 0.15;
    DetailedSource fine(flat, {1, 1}, {.refinement_factor = 8, .rocks = kShare, .seed = 3});
    const std::vector<double> h = all_of(fine);
    const double covered = static_cast<double>(std::count_if(h.begin(), h.end(), [](double x) { return x > 0; })) /
                           static_cast<double>(h.size());
    // Golombek and Rapp: those of 0.25 to 2 m, less what lies below others.
    const double q = 1.79 + 0.152 / kShare, sum = kShare * (std::exp(-q * 0.25) - std::exp(-q * 2));
    EXPECT_NEAR(covered, 1 - std::exp(-sum), 0.06 * sum);
}

TEST(TerrainDetail, FeaturesAreRoundWherePostsStandApartDifferently) {
    // Posts half as far apart along the rows as along the columns. Round features are as steep across as down.
    HeightGrid flat(401, 201, [](int, int) { return 0.0; });
    for (const bool rocks : {false, true}) {
        DetailedSource fine(
            flat, {0.5, 1},
            {.refinement_factor = 8, .craters = rocks ? 0 : 0.01, .rocks = rocks ? 0.05 : 0, .seed = 2});
        const std::vector<double> h = all_of(fine);
        const auto at = [&](int c, int r) { return h[static_cast<std::size_t>(r * fine.columns() + c)]; };
        double across = 0, down = 0;
        for (int r = 0; r + 1 < fine.rows(); ++r)
            for (int c = 0; c + 2 < fine.columns(); ++c) {
                across += std::pow(at(c + 2, r) - at(c, r), 2);
                down += std::pow(at(c, r + 1) - at(c, r), 2);
            }
        EXPECT_GT(down, 0);
        EXPECT_NEAR(across / down, 1, 0.05);
    }
}

TEST(TerrainDetail, CratersAreAsDeepAndAsManyAsPublished) {
    HeightGrid flat(301, 301, [](int, int) { return 0.0; });
    constexpr double kMany = 0.005;  // few overlap
    DetailedSource fine(flat, {1, 1}, {.refinement_factor = 8, .craters = kMany, .seed = 5});
    const std::vector<double> h = all_of(fine);
    double deepest = 0, below = 0;
    for (const double x : h) deepest = std::min(deepest, x), below += x < 0;
    EXPECT_GT(deepest, -2 * (0.196 - 0.036) * 2);
    EXPECT_LT(deepest, -2 * (0.196 - 0.036) * 0.8);
    // The bowl is below the ground within sqrt(1 - 0.036 / 0.196) radii; dN = 2 k D^-3 dD of area pi / 4 D^2 each.
    const double share = (1 - 0.036 / 0.196) * 0.25 * 3.14159265 * 2 * kMany * std::log(2 / 0.25);
    EXPECT_NEAR(below / static_cast<double>(h.size()), share, 0.1 * share);
}

}  // namespace
}  // namespace narpa
