// The bench of the filter, with few runs.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "bench/estimation/filter.h"

namespace narpa {
namespace {

TEST(BenchFilter, ErrorsAreConsistentWithTheCovariance) {
    FilterBenchSettings settings;
    settings.runs = 40;
    settings.seconds = 30;
    const auto runs = run_filter(filter_cases(), settings);
    EXPECT_EQ(runs.size(), 5u);
    for (const FilterRun& r : runs) {
        SCOPED_TRACE(r.name);
        EXPECT_NEAR(r.nees(), 12, r.band());
        EXPECT_NEAR(r.nis, 6, 4 * std::sqrt(12.0 / static_cast<double>(r.updates)));
        EXPECT_NEAR(r.band(), 1.96 * std::sqrt(24.0 / 40), 1e-12);
        const FilterTime &first = r.times.front(), &last = r.times.back();
        EXPECT_LT(last.position_rms_m, 0.8 * first.position_rms_m) << "the estimate improves";
        EXPECT_NEAR(last.position_rms_m / last.position_sigma_m, 1, 4 / std::sqrt(2.0 * 3 * settings.runs) + 0.1);
        EXPECT_LT(r.gated, 0.002 * static_cast<double>(r.updates) + 1);
        EXPECT_EQ(to_json(runs)[0].at("times").size(), 30u);
        EXPECT_NE(to_text(runs).find(r.name), std::string::npos);
    }
    const auto again = run_filter(filter_cases(), settings);
    EXPECT_EQ(runs.back().times.back().nees, again.back().times.back().nees);
}

}  // namespace
}  // namespace narpa
