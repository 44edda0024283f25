// Hosek and Wilkie's sky: the published numbers, and as a light.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>

#include "base/constants.h"
#include "renderer/light/analytic_sky.h"
#include "tests/renderer/integrator/path_support.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

using namespace narpa::test;

TEST(HosekWilkie, IsThePublishedModelToSinglePrecision) {
    // Made with the authors' program, version 1.4a, as in the source of Debian's blender 3.4.1.
    std::ifstream file(test::source_path("tests/data/hosek_wilkie.csv"));
    std::string line;
    std::getline(file, line);
    int cases = 0;
    while (std::getline(file, line)) {
        std::array<double, 8> v{};
        std::istringstream in(line);
        for (double& x : v) {
            std::string field;
            std::getline(in, field, ',');
            x = std::stod(field);
        }
        const auto xyz = HosekWilkieSky(v[0], v[1], v[2]).xyz(v[3], v[4]);
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(xyz[c], v[5 + c], 6e-8 * std::abs(v[5 + c])) << line;
        ++cases;
    }
    EXPECT_EQ(cases, 100);
}

Scene sky_scene(double elevation_deg) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, plate(4, 4));  // faces +z
    s.sun = Sun{.direction = {std::cos(elevation_deg * kRadPerDeg), 0, std::sin(elevation_deg * kRadPerDeg)}};
    s.sky = std::make_shared<AnalyticSky>();
    return s;
}

TEST(AnalyticSky, HasADensityOfOneAndSamplesByIt) {
    const Scene s = sky_scene(30);
    const AnalyticSkyBackground sky(AnalyticSky{}, *s.sun);
    double sum = 0, mean = 0;
    constexpr int kRows = 128, kColumns = 256;
    for (int i = 0; i < kRows; ++i)
        for (int j = 0; j < kColumns; ++j) {
            const double z = (i + 0.5) / kRows, phi = 2 * kPi * (j + 0.5) / kColumns, r = std::sqrt(1 - z * z);
            const Vec3 d{r * std::cos(phi), r * std::sin(phi), z};
            sum += sky.pdf(d) * 2 * kPi / (kRows * kColumns);
            mean += static_cast<double>(sky.radiance(d).y) * 2 * kPi / (kRows * kColumns);
            const BackgroundSample b = sky.sample((i + 0.5) / kRows, (j + 0.5) / kColumns);
            ASSERT_NEAR(b.pdf, sky.pdf(b.direction), 1e-6 * b.pdf);
        }
    EXPECT_NEAR(sum, 1, 1e-6);
    double estimate = 0;
    for (int i = 0; i < 10'000; ++i) {
        const BackgroundSample b = sky.sample((i % 100 + 0.5) / 100, (i / 100 + 0.5) / 100);
        estimate += static_cast<double>(b.radiance.y) / b.pdf / 10'000;
    }
    EXPECT_NEAR(estimate, mean, 0.01 * mean);
}

TEST(AnalyticSky, LightsAPlaneByItsIrradianceAndTheSunThroughTheAir) {
    const Scene s = sky_scene(30);
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const AnalyticSkyBackground sky(AnalyticSky{}, *s.sun);
    const Rgb sunlight = sunlight_transmittance(3, 30 * kRadPerDeg);
    const double direct = 0.5 / kPi * 1361 * 0.5 * static_cast<double>(sunlight.y);
    const double expected = 0.5 * static_cast<double>(sky.ambient().y) + direct;
    const Estimate e = light_along(*render_scene, placed(s), ray_to({0.3, 0.2, 3}, {}), {.max_depth = 2}, 1024);
    EXPECT_NEAR(e.mean.y, expected, 0.005 * expected);
    const Estimate one =
        light_along(*render_scene, placed(s), ray_to({0.3, 0.2, 3}, {}), {.max_depth = 1, .direct = true}, 1);
    EXPECT_NEAR(one.mean.y, expected, 0.005 * expected);
}

}  // namespace
}  // namespace narpa
