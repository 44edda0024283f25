// Charge that moves between photosites: blooming, and the tracks of cosmic rays.
#include <gtest/gtest.h>

#include "renderer/detector/blooming.h"
#include "renderer/detector/cosmic_rays.h"
#include "tests/renderer/detector/detector_support.h"

namespace narpa {
namespace {

using namespace test;

TEST(Blooming, SpillsEvenlyUpAndDownItsColumnAndConservesCharge) {
    Camera c = counting(37, 64);  // columns beyond whole batches
    c.detector->full_well_e = 1000;
    c.detector->stages = {blooming()};
    RadianceImage image(37, 64);
    const auto lit = [&](int x, int y, double e) {
        image.pixels[static_cast<std::size_t>(y * 37 + x)] = radiance_for(*c.detector, e);
    };
    lit(3, 30, 9000);                      // alone: four full above, four full below
    lit(35, 30, 1500);                     // a little: half goes each way
    lit(20, 20, 4000), lit(20, 22, 4000);  // two that meet: the charge that flows down comes first
    lit(10, 40, 600), lit(10, 41, 2000);   // a neighbour with room for less than its half
    const std::vector<int> e = electrons(c, image);
    const auto at = [&](int x, int y) { return e[static_cast<std::size_t>(y * 37 + x)]; };
    for (int y = 0; y < 64; ++y) EXPECT_EQ(at(3, y), std::abs(y - 30) <= 4 ? 1000 : 0) << y;
    EXPECT_EQ(at(35, 30), 1000);
    EXPECT_EQ(at(35, 29), 250);
    EXPECT_EQ(at(35, 31), 250);
    const auto column = [&](int x) {
        int sum = 0;
        for (int y = 0; y < 64; ++y) sum += at(x, y);
        return sum;
    };
    EXPECT_EQ(column(20), 8000);
    for (int y = 0; y < 64; ++y) EXPECT_EQ(at(20, y), y >= 17 && y <= 24 ? 1000 : 0) << y;
    EXPECT_EQ(column(10), 2600);
    EXPECT_EQ(at(10, 40), 1000);
    EXPECT_EQ(at(10, 39), 100);  // 500 up, of which 400 fill the neighbour
    EXPECT_EQ(at(10, 42), 500);
    for (const int x : {0, 2, 4, 9, 11, 19, 21, 34, 36}) EXPECT_EQ(column(x), 0) << x;
}

TEST(Blooming, ChargeLeavesOnlyOverTheEdges) {
    Camera c = counting(16, 32);
    c.detector->full_well_e = 1000;
    c.detector->stages = {blooming()};
    RadianceImage image(16, 32);
    image.pixels[2 * 16 + 5] = radiance_for(*c.detector, 11'000);  // 5000 up, where two pixels take 2000
    std::vector<int> e = electrons(c, image);
    EXPECT_EQ(std::accumulate(e.begin(), e.end(), 0), 8000);
    c.detector->stages.clear();
    e = electrons(c, image);
    EXPECT_EQ(std::accumulate(e.begin(), e.end(), 0), 1000) << "without blooming it is lost";
}

TEST(Blooming, KeepsTheChargeOfAnyImage) {
    // Random light with 3 wells in 100 pixels' column far above full; nothing near the edges.
    Camera c = counting(64, 400);
    c.detector->full_well_e = 2000;
    RadianceImage image(64, 400);
    double light = 0;
    for (int y = 100; y < 300; ++y)
        for (int x = 0; x < 64; ++x) {
            const Block w = philox({static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), 0, 0}, {2, 2});
            const int e = w[1] % 64 == 0 ? static_cast<int>(w[0] % 20000) * 2 : static_cast<int>(w[0] % 1000);
            image.pixels[static_cast<std::size_t>(y * 64 + x)] = radiance_for(*c.detector, e);
            light += e;
        }
    c.detector->stages = {blooming()};
    double charge = 0;
    for (const int e : electrons(c, image)) {
        EXPECT_LE(e, 2000);
        charge += e;
    }
    // Radiance and charge are in single precision, and each number is rounded: 0.29 e- of 25600 pixels.
    EXPECT_NEAR(charge, light, 1e-6 * light + 5 * 0.29 * std::sqrt(25600.0));
}

/// Groups of pixels with charge that touch, also by corners.
int clusters(std::vector<int> e, int width, int height) {
    int found = 0;
    std::vector<std::pair<int, int>> open;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (e[static_cast<std::size_t>(y * width + x)] <= 0) continue;
            ++found;
            open.assign(1, {x, y});
            while (!open.empty()) {
                const auto [cx, cy] = open.back();
                open.pop_back();
                if (cx < 0 || cy < 0 || cx >= width || cy >= height) continue;
                int& charge = e[static_cast<std::size_t>(cy * width + cx)];
                if (charge <= 0) continue;
                charge = 0;
                for (int k = 0; k < 9; ++k) open.push_back({cx + k % 3 - 1, cy + k / 3 - 1});
            }
        }
    return found;
}

TEST(CosmicRays, NumberMatchesTheRateAndChargeTheDepth) {
    // 256 x 256 pixels of 10 um: 0.0655 cm^2; 10 ms; 20,000 a cm^2 and second: 13.1 hits a frame, of 400 frames
    // 5243
    // +- 72. In a layer of 1 um most touch one pixel or two; two hits of a frame touch in 0.2 % of the pairs.
    Camera c = counting(256, 256);
    c.detector->pixel_pitch_m = 1e-5;
    const CosmicRays rays{.per_cm2_s = 20'000, .sensitive_depth_m = 1e-6};
    c.detector->stages = {cosmic_rays(rays)};
    c.detector->gain_e_per_dn = 0.1;  // 0.1 e- a DN: charge in tenths
    EXPECT_NEAR(mean_cosmic_rays(rays, c), 13.107, 0.001);
    double hits = 0, squares = 0;
    std::vector<double> of_hit;
    for (std::uint32_t frame = 0; frame < 400; ++frame) {
        const std::vector<int> e = dark_electrons_of(c, frame);
        const int n = clusters(e, 256, 256);
        hits += n, squares += n * n;
        if (n > 0) of_hit.push_back(0.1 * std::accumulate(e.begin(), e.end(), 0.0) / n);
    }
    const double mean = hits / 400, variance = squares / 400 - mean * mean;
    EXPECT_NEAR(mean, 13.107 * 0.99, 4 * std::sqrt(13.107 / 400));
    EXPECT_NEAR(variance / mean, 1, 4 * std::sqrt(2.0 / 400));
    // 73 e- a um; the mean of 1 / cos of the zenith angle is 2, its median sqrt(2): most hits leave about a
    // hundred.
    std::nth_element(of_hit.begin(), of_hit.begin() + 200, of_hit.end());
    EXPECT_GT(of_hit[200], 73);
    EXPECT_LT(of_hit[200], 2 * 73);
}

TEST(CosmicRays, TracksAreStraightAndHoldTheirCharge) {
    // Deep silicon and small pixels: long tracks. One hit a frame on average.
    Camera c = counting(200, 200);
    c.detector->pixel_pitch_m = 1e-6;
    c.detector->stages = {cosmic_rays({.per_cm2_s = 1e6, .sensitive_depth_m = 1e-5})};
    c.detector->exposure_s = 0.0025;
    int tracks = 0;
    for (std::uint32_t frame = 0; frame < 200; ++frame) {
        const std::vector<int> e = dark_electrons_of(c, frame);
        if (clusters(e, 200, 200) != 1) continue;
        // Moments about the centre: the track's thickness is that of a pixel.
        double charge = 0, mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
        bool inside = true;
        for (int y = 0; y < 200; ++y)
            for (int x = 0; x < 200; ++x) {
                const double q = e[static_cast<std::size_t>(y * 200 + x)];
                charge += q, mx += q * x, my += q * y;
                inside &= q == 0 || (x > 0 && y > 0 && x < 199 && y < 199);
            }
        if (!inside) continue;
        mx /= charge, my /= charge;
        for (int y = 0; y < 200; ++y)
            for (int x = 0; x < 200; ++x) {
                const double q = e[static_cast<std::size_t>(y * 200 + x)] / charge;
                xx += q * (x - mx) * (x - mx), yy += q * (y - my) * (y - my), xy += q * (x - mx) * (y - my);
            }
        const double sum = xx + yy, root = std::hypot(xx - yy, 2 * xy);
        EXPECT_LT((sum - root) / 2, 0.2) << "variance across the track, px^2";
        // A line of length l has the variance l^2 / 12 along it; 73 e- a um of hypot(l, depth).
        const double length = std::sqrt(12 * std::max(0.0, (sum + root) / 2 - 1.0 / 12));
        EXPECT_NEAR(charge / (73 * std::hypot(length, 10.0)), 1, 0.06) << length;
        ++tracks;
    }
    EXPECT_GT(tracks, 30);
}

TEST(CosmicRays, AreRepeatableAndOthersInEachFrame) {
    Camera c = counting(256, 256);
    c.detector->stages = {cosmic_rays({.per_cm2_s = 1e6})};
    EXPECT_EQ(dark_electrons_of(c, 4), dark_electrons_of(c, 4));
    EXPECT_NE(dark_electrons_of(c, 4), dark_electrons_of(c, 5));
}

}  // namespace
}  // namespace narpa
