// Frames with less than one sample per pixel: what was traced is shown as it is, silhouettes stay where they are,
// more rays mean less error, and the error is known.
#include "tests/renderer/frame/budget_support.h"

namespace narpa {
namespace {

using namespace test;
using Method = RenderSettings::Method;

Rgb pixel_of(const RadianceImage& image, int x, int y) {
    return image.pixels[static_cast<std::size_t>(y * image.width + x)];
}

TEST(PixelFill, TracedPixelsShowWhatAFrameOfOneSampleShows) {
    for (const auto& [width, height] : {std::pair{72, 51}, {33, 21}, {7, 5}}) {
        const BudgetView v = craft_over_a_globe(width, height);
        const RadianceImage whole = render(v, samples_a_pixel(v, 1, 4)).image;
        int coarse = 0;
        for (double rays = 0.06; rays < 0.4; rays *= 1.1) {
            const Shown shown = render(v, rays_a_pixel(v, rays, 4));
            if (shown.account.step != FrameStep::coarse_4) continue;
            ++coarse;
            EXPECT_TRUE(is_whole(shown.image));
            for (int y = 0; y < height; y += 4)
                for (int x = 0; x < width; x += 4)
                    ASSERT_EQ(pixel_of(shown.image, x, y), pixel_of(whole, x, y)) << x << ' ' << y;
        }
        EXPECT_GT(coarse, 0) << width;
    }
}

/// A plate that faces camera and Sun before empty space: two radiances, and no other.
BudgetView plate_in_space(const Vec3& at, double turn_rad) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, plate(4, 3), {exp_rotation({0, 0, turn_rad}), at});
    add_sun(s, {0, 0, 1});
    return {std::move(s), 64, 48, 60, looking({0, 0, 10}, {0, 0, 0}, {0, 1, 0})};
}

TEST(PixelFill, NoPixelMixesTheTwoSidesOfASilhouette) {
    const BudgetView v = plate_in_space({0.1, 0.2, 0}, 0.3);
    const RadianceImage whole = render(v, samples_a_pixel(v, 1)).image;
    const float lit = std::max_element(whole.pixels.begin(), whole.pixels.end(), [](const Rgb& a, const Rgb& b) {
                          return a.x < b.x;
                      })->x;
    for (const double rays : {0.2, 0.3, 0.45, 0.6}) {
        const Shown shown = render(v, rays_a_pixel(v, rays));
        ASSERT_TRUE(is_filled(shown.account.step)) << rays;
        if (shown.account.step == FrameStep::sparse) continue;  // samples of edges are means
        for (const Rgb& p : shown.image.pixels) EXPECT_TRUE(p.x == 0 || std::abs(p.x - lit) < 1e-5f * lit) << p.x;
    }
}

TEST(PixelFill, SilhouettesAreNotMoved) {
    // The centroid of a plate at 24 places in the pixel grid, in pixels from that of many samples.
    for (const double rays : {0.2, 0.45, 1.0, 2.0}) {
        double sum = 0, squares = 0;
        constexpr int kPlaces = 24;
        for (int i = 0; i < kPlaces; ++i) {
            const BudgetView v = plate_in_space({0.021 * i, 0.013 * (i * 7 % 24), 0}, 0.26 * i);
            const auto centre_of = [&](const RadianceImage& image) {
                double weight = 0, x = 0;
                for (int row = 0; row < image.height; ++row)
                    for (int column = 0; column < image.width; ++column) {
                        const double light = static_cast<double>(pixel_of(image, column, row).x);
                        weight += light, x += light * column;
                    }
                return x / weight;
            };
            const double off = centre_of(render(v, rays_a_pixel(v, rays, static_cast<std::uint32_t>(i))).image) -
                               centre_of(render(v, samples_a_pixel(v, 256)).image);
            sum += off, squares += off * off;
        }
        const double mean = sum / kPlaces, sigma = std::sqrt(squares / kPlaces / kPlaces);
        EXPECT_LT(std::abs(mean), 4 * sigma) << rays;
        EXPECT_LT(std::abs(mean), rays < 1 ? 0.1 : 0.02) << rays;
    }
}

TEST(PixelFill, ErrorFallsAtEveryStepAndIsKnown) {
    const BudgetView v = craft_over_a_globe(200, 150);
    const std::vector<double> truth = truth_of(v, 512);
    CameraRenderer renderer(v.render_scene, v.camera);
    double before = 1e9;
    for (const double rays : {0.14, 0.4, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 8.0}) {
        double measured = 0, predicted = 0;
        for (std::uint32_t k = 0; k < 3; ++k) {
            const Shown shown = render(renderer, v, rays_a_pixel(v, rays, k));
            EXPECT_GE(shown.account.standard_error, 0) << rays;
            measured += misses_of(shown.image, truth).squared;
            predicted += shown.account.standard_error * shown.account.standard_error;
        }
        EXPECT_LT(measured, before) << rays;
        const double ratio = std::sqrt(predicted / measured);
        EXPECT_GE(ratio, 0.7) << rays;
        EXPECT_LE(ratio, 1.5) << rays;
        before = measured;
    }
}

/// A sphere seen from far away, whose neighbouring pixels hardly differ, with bars that no coarse lattice shows.
BudgetView bars_on_a_smooth_ground(double shift) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_sphere(s, 3e6, {0, 0, -3e6});
    for (int i = 0; i < 12; ++i)
        add_mesh(s, box(0.05, 0.05, 0.5), {Quat{}, {0.53 * i - 3 + shift, 0.41 * i - 2.5, 0}});
    add_sun(s, {0.2, 0.1, 1});
    return {std::move(s), 128, 96, 128, looking({0, 0, 10}, {0, 0, 0}, {0, 1, 0})};
}

TEST(PixelFill, DetailsOnSmoothGroundAreNotTakenForItsError) {
    double largest = 0;
    for (int i = 0; i < 12; ++i) {
        const BudgetView v = bars_on_a_smooth_ground(0.013 * i);
        const std::vector<double> truth = truth_of(v, 64);
        const Shown shown = render(v, rays_a_pixel(v, 1, static_cast<std::uint32_t>(i)));
        largest =
            std::max(largest, shown.account.standard_error / std::sqrt(misses_of(shown.image, truth).squared));
    }
    EXPECT_LT(largest, 3.8);
}

TEST(PixelFill, HalfTheRaysOfOneSampleAPixelHaveNoLargerError) {
    const BudgetView v = craft_over_a_globe(200, 150);
    const std::vector<double> truth = truth_of(v, 512);
    const Shown one = render(v, samples_a_pixel(v, 1));
    FrameSettings s = rays_a_pixel(v, 0);
    s.budget.rays = one.account.rays / 2;
    EXPECT_LT(misses_of(render(v, s).image, truth).squared, misses_of(one.image, truth).squared);
}

TEST(PixelFill, NearlyAllRaysAreUsed) {
    const BudgetView v = craft_over_a_globe(200, 150);
    CameraRenderer renderer(v.render_scene, v.camera);
    for (double rays = 0.2; rays < 3; rays *= 1.31) {
        const FrameSettings s = rays_a_pixel(v, rays, 1);
        const FrameAccount account = render(renderer, v, s).account;
        EXPECT_LE(account.rays + account.rays_discarded, s.budget.rays) << rays;
        EXPECT_GE(account.rays, 0.95 * static_cast<double>(s.budget.rays)) << rays;
    }
}

TEST(PixelFill, PathsFillWhatDoesNotFitAndTheErrorIsKnown) {
    const BudgetView v = craft_over_a_globe(200, 150);
    const std::vector<double> truth = truth_of(v, 512, Method::path);
    CameraRenderer renderer(v.render_scene, v.camera);
    const Shown one = render(renderer, v, samples_a_pixel(v, 1, 0, Method::path));
    const double of_one = misses_of(one.image, truth).squared;
    double before = 1e9;
    for (const double part : {1.0 / 14, 0.15, 0.3, 0.5, 1.0, 1.6, 2.5, 4.0, 6.0}) {
        double measured = 0, predicted = 0, used = 0;
        for (std::uint32_t k = 0; k < 3; ++k) {
            FrameSettings s = rays_a_pixel(v, 0, k, Method::path);
            s.budget.rays = static_cast<std::uint64_t>(part * static_cast<double>(one.account.rays));
            const Shown shown = render(renderer, v, s);
            EXPECT_GE(shown.account.standard_error, 0) << part;
            measured += misses_of(shown.image, truth).squared / 3;
            predicted += shown.account.standard_error * shown.account.standard_error / 3;
            // Samples of sunlight are planned from centres, which are then discarded.
            const bool planned = shown.account.passes[kSunlightPass] > 0;
            const std::uint64_t rays = shown.account.rays + (planned ? shown.account.rays_discarded : 0);
            used += static_cast<double>(rays) / static_cast<double>(s.budget.rays) / 3;
        }
        EXPECT_LT(measured, before) << part;
        if (part >= 0.5) {
            EXPECT_LT(measured, 1.2 * of_one) << part;
        }
        const double ratio = std::sqrt(predicted / measured);
        EXPECT_GE(ratio, 0.7) << part;
        EXPECT_LE(ratio, 1.5) << part;
        EXPECT_GE(used, 0.9) << part;
        before = measured;
    }
}

}  // namespace
}  // namespace narpa
