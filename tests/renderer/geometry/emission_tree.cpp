#include "renderer/geometry/emission_tree.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// Triangles of all sizes and attitudes, in clumps.
std::vector<EmissiveFace> scattered_faces(std::mt19937_64& random, std::uint32_t n) {
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<EmissiveFace> faces;
    Vec3 clump{};
    for (std::uint32_t k = 0; k < n; ++k) {
        if (k % 5 == 0) clump = 8 * unit(random) * random_direction(random);
        const double size = std::exp(4 * unit(random) - 3);
        EmissiveFace f{3 * k};
        for (Vec3& p : f.corner_m) p = clump + size * random_direction(random);
        f.power = size * size * (0.1 + unit(random));
        faces.push_back(f);
    }
    return faces;
}

EmissionTree::Seen seen_from(const Vec3& position, const Vec3& up) {
    return {-position, up};
}

/// Power of a face that a small horizontal patch at the receiver can get, without occlusion.
bool can_send(const EmissiveFace& f, const EmissionTree::Seen& from) {
    const Vec3 normal = cross(f.corner_m[1] - f.corner_m[0], f.corner_m[2] - f.corner_m[0]);
    bool above = false;
    for (const Vec3& p : f.corner_m) above = above || dot(p + from.to_origin_m, from.up) > 0;
    return above && dot(normal, f.corner_m[0] + from.to_origin_m) != 0;
}

TEST(EmissionTree, EveryFaceThatCanSendLightIsChosenAsOftenAsItsProbabilitySays) {
    std::mt19937_64 random(1);
    for (const std::uint32_t n : {1u, 2u, 3u, 17u, 300u}) {
        const EmissionTree tree(scattered_faces(random, n));
        ASSERT_EQ(tree.faces().size(), n);
        for (int trial = 0; trial < 20; ++trial) {
            const double distance = trial % 4 == 0 ? 1e4 : 10;
            const EmissionTree::Seen from =
                seen_from(distance * random_direction(random), random_direction(random));
            std::vector<double> probability(n);
            double sum = 0;
            for (std::size_t k = 0; k < n; ++k) {
                const EmissiveFace& f = tree.faces()[k];
                sum += probability[k] = f.power * tree.probability_per_power(from, f.face);
                if (can_send(f, from)) {
                    EXPECT_GT(probability[k], 0);
                }
                EXPECT_EQ(tree.probability_per_power(from, f.face + 1), 0);
            }
            if (sum == 0) {
                EXPECT_FALSE(tree.choose(from, 0.5).has_value());
                continue;
            }
            EXPECT_LE(sum, 1 + 1e-9);
            constexpr int kChoices = 20000;
            std::vector<int> chosen(n);
            int found = 0;
            for (int i = 0; i < kChoices; ++i)
                if (const auto k = tree.choose(from, (i + 0.5) / kChoices)) ++chosen[*k], ++found;
            EXPECT_NEAR(found, kChoices * sum, 2 + 2.0 * n);
            // Each cut of the interval of choices moves a border of a face's part by less than one choice.
            for (std::size_t k = 0; k < n; ++k) EXPECT_NEAR(chosen[k], kChoices * probability[k], 2);
        }
    }
}

TEST(EmissionTree, ChoosesTheNearFaceOfManyEqualOnes) {
    std::vector<EmissiveFace> faces;
    for (std::uint32_t k = 0; k < 16; ++k) {
        const double x = 1.0 * k;
        faces.push_back({k, {Vec3{x, 0, 1}, Vec3{x + 0.3, 0, 1}, Vec3{x, 0.3, 1}}, 1});
    }
    const EmissionTree tree(faces);
    for (std::uint32_t k = 0; k < 16; ++k) {
        const EmissionTree::Seen below = seen_from({1.0 * k + 0.1, 0.1, 0}, {0, 0, 1});
        EXPECT_GT(tree.probability_per_power(below, k), 0.4) << k;
        const EmissionTree::Seen turned = seen_from({1.0 * k + 0.1, 0.1, 0}, {0, 0, -1});
        EXPECT_EQ(tree.probability_per_power(turned, k), 0);
        EXPECT_FALSE(tree.choose(turned, 0.3).has_value());
    }
}

}  // namespace
}  // namespace narpa
