// The bench of the filter, in small, and the pictures of both benches of estimates.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "../support/temporary_folder.h"
#include "bench/estimate_plots.h"
#include "renderer/scene/texture_file.h"

namespace narpa {
namespace {

TEST(BenchFilter, ErrorsAreWhatTheCovarianceSays) {
    FilterBenchSettings settings;
    settings.runs = 40;
    settings.seconds = 30;
    const auto runs = run_filter(filter_cases(), settings);
    ASSERT_TRUE(runs) << runs.error().text();
    EXPECT_EQ(runs->size(), 5u);
    for (const FilterRun& r : *runs) {
        SCOPED_TRACE(r.name);
        EXPECT_NEAR(r.nees(), 12, r.band());
        EXPECT_NEAR(r.nis, 6, 4 * std::sqrt(12.0 / static_cast<double>(r.updates)));
        EXPECT_NEAR(r.band(), 1.96 * std::sqrt(24.0 / 40), 1e-12);
        const FilterTime &first = r.times.front(), &last = r.times.back();
        EXPECT_LT(last.position_rms_m, 0.8 * first.position_rms_m) << "it learns";
        EXPECT_NEAR(last.position_rms_m / last.position_sigma_m, 1, 4 / std::sqrt(2.0 * 3 * settings.runs) + 0.1);
        EXPECT_LT(r.gated, 0.002 * static_cast<double>(r.updates) + 1);
        EXPECT_EQ(to_json(r).at("times").size(), 30u);
        EXPECT_NE(in_words(*runs).find(r.name), std::string::npos);
    }
    const auto again = run_filter(filter_cases(), settings);
    ASSERT_TRUE(again);
    EXPECT_EQ(runs->back().times.back().nees, again->back().times.back().nees);
    EXPECT_FALSE(run_filter(filter_cases(), {.runs = 0}));
}

TEST(EstimatePlots, ShowEveryRun) {
    const test::TemporaryFolder folder;
    const auto filter = run_filter({filter_cases()[0]}, {.runs = 3, .seconds = 5});
    ASSERT_TRUE(filter);
    ASSERT_TRUE(write_filter_plot(folder / "filter.png", "three flights", *filter));
    EXPECT_GT(std::filesystem::file_size(folder / "filter.png"), 5000u);

    std::vector<IcpRun> runs;
    for (const double angle : {5.0, 30.0})
        for (const double fraction : {0.05, 0.2}) {
            IcpRun run{{angle, fraction, 10}};
            run.found = angle > 10 ? 0 : 10;
            runs.push_back(run);
        }
    ASSERT_TRUE(write_icp_plot(folder / "icp.png", "forty starts", runs));
    const auto picture = read_texture(folder / "icp.png");
    ASSERT_TRUE(picture) << picture.error().text();
    int green = 0, white = 0;
    for (std::size_t i = 0; i + 2 < picture->rgb.size(); i += 3) {
        const auto [red, more, blue] = std::tuple{picture->rgb[i], picture->rgb[i + 1], picture->rgb[i + 2]};
        green += more > 1.5 * red && more > 1.5 * blue;
        white += std::min({red, more, blue}) == 65535;
    }
    EXPECT_GT(green, 10'000) << "the fields where all were found";
    EXPECT_GT(white, 10'000);

    EXPECT_FALSE(write_icp_plot(folder / "none.png", "", {}));
    EXPECT_FALSE(write_filter_plot(folder / "none.png", "", {}));
}

}  // namespace
}  // namespace narpa
