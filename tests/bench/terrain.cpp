// `narpa bench terrain` as it is run: counts and the shape of its output; never times.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "bench/terrain_cost.h"
#include "tests/support/command.h"

namespace narpa {
namespace {

TEST(BenchTerrain, CountsTheTrianglesThatEachViewSees) {
    const test::Done done = test::run_command(
        std::string(test::kTimeLimit) + NARPA_BIN +
        " bench terrain --posts 400 --heights 600,100 --visible-rays 2 --turns 1 --json 2>/dev/null");
    ASSERT_EQ(done.status, 0) << done.out;
    const auto found = nlohmann::json::parse(done.out);
    EXPECT_EQ(found["all_triangles"], 2 * 399 * 399);
    const auto all = found["triangles"].get<std::size_t>();
    EXPECT_LE(all, 2u * 399 * 399);
    ASSERT_EQ(found["rows"].size(), 2u);
    for (const auto& row : found["rows"]) {
        const auto triangles = [&](const char* of) { return row[of]["triangles"].get<std::size_t>(); };
        EXPECT_EQ(triangles("terrain"), all);
        EXPECT_LE(triangles("visible"), all);
        EXPECT_LE(triangles("met"), triangles("visible"));
        EXPECT_LE(triangles("met"), 640u * 480);
        EXPECT_LE(triangles("for_this_height"), all) << "one height asks for no more than all of them";
        EXPECT_GT(triangles("for_this_height"), 1000u);
        EXPECT_GT(row["ratio"].get<double>(), 0);
    }
    EXPECT_EQ(found["rows"][1]["rays"], 4 * 640 * 480);
    EXPECT_EQ(found["rows"][1]["missed"], 0) << "100 m above a ground of 800 m";
    EXPECT_EQ(found["rows"][1]["from_below"], 0);
    EXPECT_EQ(found["rows"][0]["from_below"], 0);
    EXPECT_GT(found["rows"][0]["visible"]["triangles"], found["rows"][1]["visible"]["triangles"]);
}

TEST(BenchTerrain, FaultsNameTheHeightAndTheBound) {
    TerrainCost cost;
    for (const double ns : {130.0, 131.0}) {
        TerrainCostRow row{.height_m = ns};
        row.terrain.ns = ns, row.visible.ns = 100;
        cost.rows.push_back(row);
    }
    cost.rows[0].rays = 1000, cost.rows[0].from_below = 2;
    EXPECT_EQ(
        terrain_cost_faults(cost),
        (std::vector<std::string>{"from 130 m: 2 of 1000 rays meet the terrain from below, expected none",
                                  "from 131 m: 1.31 times a mesh of the visible triangles, expected at most 1.3"}));
}

TEST(BenchTerrain, HeightsAreAboveTheGround) {
    const test::Done done =
        test::run_command(std::string(test::kTimeLimit) + NARPA_BIN + " bench terrain --heights 100,-5 2>&1");
    EXPECT_EQ(done.status, 2);
    EXPECT_NE(done.out.find("--heights: Value -5 not in range"), std::string::npos) << done.out;
}

}  // namespace
}  // namespace narpa
