// `narpa bench lidar` as it is run: counts, errors and the shape of its output; never times.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "bench/lidar_cost.h"
#include "tests/support/command.h"

namespace narpa {
namespace {

using test::Done;

Done bench_lidar(const std::string& arguments, const std::string& streams) {
    return test::run_command(std::string(test::kTimeLimit) + NARPA_BIN + " bench lidar " + arguments + streams);
}

TEST(BenchLidar, RangeErrorFallsWithTheNumberOfSubRays) {
    const Done done = bench_lidar("--sub-rays 1,8,64 --reference-sub-rays 512 --turns 1 --json", " 2>/dev/null");
    ASSERT_EQ(done.status, 0) << done.out;
    const auto found = nlohmann::json::parse(done.out);
    EXPECT_EQ(found["make"], "VLP-16");
    EXPECT_EQ(found["packets"], 75);
    EXPECT_EQ(found["shots"], 75 * 384);
    const auto returns = found["returns"].get<int>();
    EXPECT_GT(returns, 5000);
    ASSERT_EQ(found["rows"].size(), 3u);
    double before_m = 1e300;
    for (const auto& row : found["rows"]) {
        const auto& error = row["error"];
        EXPECT_LT(error["same_surface_rms_m"].get<double>(), before_m) << row;
        before_m = error["same_surface_rms_m"].get<double>();
        EXPECT_GE(error["shots"].get<int>() + error["lost"].get<int>(), returns) << row;
        EXPECT_GT(row["shots_per_s"].get<double>(), 0) << row;
        EXPECT_GT(row["to_embree"].get<double>(), 0) << row;
    }
    EXPECT_LT(before_m, 0.01) << "64 sub-rays";
    EXPECT_EQ(found["rows"][2]["sub_rays"], 64);
}

TEST(BenchLidar, SubRaysThatNoBeamHasAreRefused) {
    const Done done = bench_lidar("--sub-rays 1,3", " 2>&1");
    EXPECT_EQ(done.status, 2);
    EXPECT_NE(done.out.find("--sub-rays 3, expected 1, or 8 to "), std::string::npos) << done.out;
}

TEST(BenchLidar, FaultsNameTheLoadAndItsBound) {
    LidarCost cost;
    cost.make = "VLP-16";
    cost.rate_hz = 10;
    cost.covers_s = 0.1;
    for (const auto& [sub_rays, fire_s] : {std::pair{1, 0.004}, std::pair{16, 0.026}}) {
        LidarCostRow& row = cost.rows.emplace_back();
        row.sub_rays = sub_rays;
        row.fire_s = fire_s;
    }
    EXPECT_EQ(lidar_cost_faults(cost),
              std::vector<std::string>{"16 sub-rays: 26.0 % of a core, expected at most 25 %"});
    cost.rate_hz = 20;
    EXPECT_TRUE(lidar_cost_faults(cost).empty()) << "the bounds are for 10 Hz";
}

}  // namespace
}  // namespace narpa
