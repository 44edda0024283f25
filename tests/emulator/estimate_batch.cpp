// All frames and sweeps of a logged run in one least-squares problem, by the command: errors that are put into the
// model are found, and bad input is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"

namespace narpa::test {
namespace {

using nlohmann::json;

class EstimateBatch : public LoopTest {
protected:
    /// Twelve seconds of the docking approach in lockstep, 30 frames.
    void fly(const std::vector<std::string>& further = {}) {
        std::vector<std::string> changes{"camera.nav.rate_hz=2.5", "render.spp=4"};
        changes.insert(changes.end(), further.begin(), further.end());
        auto scene = read_scene(test::build_path("scenes/docking/docking.toml"), changes);
        ASSERT_TRUE(scene) << scene.error().text();
        RunOptions o;
        o.video = {{"nav", "none"}};
        o.bus = record_approach(28'000'000'000, 40'050'000'000);
        o.lockstep = true;
        o.log_folder = log_;
        ASSERT_NE(ran(*std::move(scene), o), nullptr);
    }
    [[nodiscard]] Done batch(const std::string& options) const {
        return run_command(NARPA_BIN " estimate " + log_ + " --batch " + options + " 2>&1");
    }
    /// The document of a batch that succeeds.
    [[nodiscard]] json told(const std::string& options) const {
        const Done done = batch(options + " --json");
        EXPECT_EQ(done.status, 0) << done.out;
        return json::parse(done.out.substr(done.out.find("\n{") + 1))["batch"];
    }
    static json unknown(const json& batch, const std::string& name) {
        for (const json& u : batch["unknowns"])
            if (u["name"] == name) return u;
        ADD_FAILURE() << "no unknown " << name;
        return {};
    }
    const std::string log_ = folder_ / "log";
};

/// Its distortion cannot be changed in a render, its brightness is compared nevertheless.
TEST_F(EstimateBatch, FindsTheAlbedoWithAFisheye) {
    fly({R"(camera.nav.distortion={model = "fisheye", coefficients = [0.02, 0.0, 0.0, 0.0]})"});
    const json found = told("--camera nav --every 5 --model-error albedo=0.1");
    const json albedo = unknown(found, "albedo");
    EXPECT_TRUE(albedo["determined"]);
    EXPECT_NEAR(albedo["change"].get<double>(), 1 / 1.1 - 1, 0.01);
    EXPECT_LT(albedo["error_of_sigma"].get<double>(), 4.5);
}

TEST_F(EstimateBatch, FindsErrorsThatArePutIntoTheModel) {
    fly();
    const std::string csv = folder_ / "batch.csv";
    const json all = told("--method marks --every 3 --path-sigma 0.001,0.0005 --csv " + csv +
                          " --model-error scale=0.01,focal=-0.01,centre_px.x=2,k1=0.02,camera_mount_deg=0.3,"
                          "lidar_mount_deg.y=0.3,clock_s=0.02,range_bias_m=0.03,albedo=0.1,light_deg.x=-1.5");
    EXPECT_EQ(all["linear_solver"], "SPARSE_NORMAL_CHOLESKY");
    EXPECT_LT(unknown(all, "clock_s")["sigma"].get<double>(), 0.005);
    for (const char* name : {"scale", "focal", "camera_mount_deg.z", "lidar_mount_deg.y", "clock_s", "range_bias_m",
                             "albedo", "light_deg.x"})
        EXPECT_TRUE(unknown(all, name)["determined"]) << name;
    for (const json& u : all["unknowns"]) EXPECT_LT(u["error_of_sigma"].get<double>(), 4.5) << u["name"];
    EXPECT_NEAR(unknown(all, "scale")["change"].get<double>(), 1 / 1.01 - 1, 0.002);
    EXPECT_NEAR(unknown(all, "lidar_mount_deg.y")["change"].get<double>(), -0.3, 0.05);
    EXPECT_NEAR(unknown(all, "light_deg.x")["change"].get<double>(), 1.5, 0.3);
    EXPECT_NEAR(unknown(all, "albedo")["change"].get<double>(), 1 / 1.1 - 1, 0.01);
    EXPECT_NEAR(unknown(all, "clock_s")["truth"].get<double>(), 0.02, 1e-12);
    const auto rows = read_rows(csv);
    ASSERT_GT(rows.size(), 30u);
    EXPECT_EQ(rows.front().at("sensor"), "camera");
    EXPECT_EQ(rows.back().at("sensor"), "brightness");
    EXPECT_GT(std::ranges::count_if(rows, [](const auto& row) { return row.at("sensor") == "lidar"; }), 10);
    EXPECT_LT(std::stod(rows.front().at("residual_rms")), 0.5) << "pixels";

    // One camera alone tells neither the size nor, over an unknown path, its clock.
    const json camera = told("--method marks --camera nav");
    for (const char* name : {"scale", "clock_s"}) EXPECT_FALSE(unknown(camera, name)["determined"]) << name;
    EXPECT_EQ(unknown(camera, "focal")["truth"], 0);
    // Nor does noise of positions move the clock: the chaser's attitude, which could tell it, hardly changes.
    const json lidar = told("--lidar top --unknowns clock_s --model-error clock_s=0.1");
    EXPECT_NEAR(unknown(lidar, "clock_s")["change"].get<double>(), 0, 0.01);
    EXPECT_LT(lidar["nees_mean"].get<double>(), 12);
    EXPECT_GE(camera["not_determined"].size(), 2u);

    const auto refuses = [&](const std::string& options, const std::string& words) {
        const Done done = batch(options);
        EXPECT_EQ(done.status, 2) << done.out;
        EXPECT_NE(done.out.find(words), std::string::npos) << done.out;
    };
    refuses("--method marks --camera nav --every 20", "at 2 times, expected at least 4");
    refuses("--start search", "--batch follows the target from frame to frame: expected --start DEG,PERCENT");
    refuses("--method dense", "expected --method features or marks");
    refuses("--unknowns focus=1", "expected NAME=VALUE with one of scale, focal, aspect, centre_px, k1");
    refuses("--unknowns focal=-1", "expected focal=NUMBER, 0 or more");
    refuses("--model-error focal", "expected NAME=VALUE with one of scale");
    refuses("--path-sigma 1", "expected DEG,METRES above 0");
    refuses("--camera front", "no camera named \"front\", expected one of: nav");
    const Done both = run_command(NARPA_BIN " estimate " + log_ + " --camera nav --lidar top 2>&1");
    EXPECT_EQ(both.status, 2);
    EXPECT_NE(both.out.find("expected one of them, or --batch too"), std::string::npos) << both.out;
    const Done alone = run_command(NARPA_BIN " estimate " + log_ + " --unknowns focal 2>&1");
    EXPECT_EQ(alone.status, 2);
    EXPECT_NE(alone.out.find("--unknowns goes with --batch"), std::string::npos) << alone.out;
}

}  // namespace
}  // namespace narpa::test
